"""Code size, memory, stack and operations of a control tick in C, as tables in Markdown.

    python tests/benchmarks/c_code.py [PREFIX]

PREFIX is that of a compiler for Cortex-M, such as ``arm-none-eabi-``. Operations are counted by a C++ class
in place of the number type, over a recorded run; this needs g++.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import spheretwin as st
from spheretwin.export.c_library import write_c
from spheretwin.export.controller_code import controller_code

CASES = {
    "PD": {"controller.law": "pd"},
    "PID": {"controller.law": "pid"},
    "AFSM": {"controller.law": "afsm"},
    "AFSM-ESO": {"controller.law": "afsm_eso"},
    "AFSM-ESO `prototype`, Kalman": {
        "controller.law": "afsm_eso", "controller.preset": "prototype", "estimator.kind": "kalman",
        "nominal.delay_s": 1.5e-3, "nominal.coulomb_Nm": [2e-3] * 3,
    },
    "PID, bounded allocation": {"controller.law": "pid", "allocation": "bounded"},
}  # fmt: skip
RUN = {"plant.engine": "lagrangian", "duration": 1.0, "nominal.current_limit_A": 1.5, "disturbance.load": 1.0}
CORES = {
    "Cortex-M4, float": ["-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-DST_SINGLE"],
    "Cortex-M4, double": ["-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"],
    "Cortex-M7, double": ["-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-d16"],
}
COUNTER = """
#include <cmath>
struct Number {
    double v;
    static long adds, products, divisions, roots, calls;
    Number() : v(0) {}
    Number(double x) : v(x) {}
    explicit operator int() const { return (int)v; }
};
long Number::adds, Number::products, Number::divisions, Number::roots, Number::calls;
#define PAIR(op, count) \\
    inline Number operator op(Number a, Number b) { Number::count++; return Number(a.v op b.v); }
PAIR(+, adds) PAIR(-, adds) PAIR(*, products) PAIR(/, divisions)
inline Number operator-(Number a) { return Number(-a.v); }
#define CHANGE(op, base) inline Number &operator op(Number &a, Number b) { a = a base b; return a; }
CHANGE(+=, +) CHANGE(-=, -) CHANGE(*=, *) CHANGE(/=, /)
#define ORDER(op) inline bool operator op(Number a, Number b) { return a.v op b.v; }
ORDER(<) ORDER(>) ORDER(<=) ORDER(>=) ORDER(==) ORDER(!=)
#define CALL(name, count) \\
    inline Number st_##name(Number a) { Number::count++; return Number(std::name(a.v)); }
CALL(sin, calls) CALL(cos, calls) CALL(exp, calls) CALL(sqrt, roots)
inline Number st_fabs(Number a) { return Number(std::fabs(a.v)); }
inline Number st_pow(Number a, Number b) { Number::calls++; return Number(std::pow(a.v, b.v)); }
inline Number st_copysign(Number a, Number b) { return Number(std::copysign(a.v, b.v)); }
#define ST_REAL Number
#include "st_controller.c"
#include <cstdio>
int main()
{
    double v[15];
    st_controller controller;
    st_controller_start(&controller);
    for (;;) {
        st_real reference[3][3], angle[3], rate[3], command[ST_GROUPS];
        for (int i = 0; i < 15; i++) {
            if (scanf("%lf", v + i) != 1) return 0;
        }
        for (int i = 0; i < 9; i++) reference[i / 3][i % 3] = v[i];
        for (int i = 0; i < 3; i++) { angle[i] = v[9 + i]; rate[i] = v[12 + i]; }
        Number::adds = Number::products = Number::divisions = Number::roots = Number::calls = 0;
        st_controller_tick(&controller, reference, angle, rate, command);
        printf("%ld %ld %ld %ld %ld\\n", Number::adds, Number::products, Number::divisions, Number::roots,
            Number::calls);
    }
}
"""


def run(*command, **settings):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **settings)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout


def operations(folder, changes):
    """Sums, products, divisions, square roots and calls of libm in each tick of a recorded run."""
    (folder / "count.cpp").write_text(COUNTER)
    run("g++", "-O1", "-w", "-fpermissive", "-o", folder / "count", folder / "count.cpp")
    table = st.simulate("nutation", RUN | changes).telemetry
    reference = st.load("nutation", RUN | changes).trajectory.sample(table["t_s"]).reshape(-1, 9)
    rows = np.hstack([reference, table["q_rad"], table["qdot_rad_s"]])
    text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    return np.loadtxt(run(folder / "count", input=text).splitlines())


def stack(listing):
    """Deepest stack of a tick, bytes, by the call graph of the compiler; functions of libm are left out."""
    names = re.findall(r'node: \{ title: "([^"]+)" label: "[^"]*?(\d+) bytes', listing)
    own = {name: int(size) for name, size in names}
    calls = re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', listing)

    def depth(name):
        return own.get(name, 0) + max(
            (depth(target) for source, target in calls if source == name), default=0
        )

    return depth("st_controller_tick")


def sizes(folder, compiler, flags, size):
    """Bytes of code and of constants, of the state, and of the stack."""
    made = folder / "tick.o"
    flags = [*flags, "-std=c99", "-Os", "-fcallgraph-info=su"]
    run(compiler, *flags, "-c", folder / "st_controller.c", "-o", made)
    sections = dict(re.findall(r"^(\.\S+)\s+(\d+)", run(size, "-A", made), re.MULTILINE))
    count = {
        kind: sum(int(n) for s, n in sections.items() if s.startswith(kind)) for kind in (".text", ".rodata")
    }
    (folder / "state.c").write_text('#include "st_controller.h"\nst_controller state;\n')
    run(compiler, *flags, "-c", folder / "state.c", "-o", folder / "state.o")
    state = re.search(r"^\.bss\s+(\d+)", run(size, "-A", folder / "state.o"), re.MULTILINE)
    listing = (folder / "tick.ci").read_text()
    return count[".text"], count[".rodata"], int(state[1]), stack(listing)


def main():
    prefix = sys.argv[1] if len(sys.argv) > 1 else None
    kinds = (
        {name: (f"{prefix}gcc", flags, f"{prefix}size") for name, flags in CORES.items()} if prefix else {}
    )
    kinds["x86-64, double"] = ("gcc", [], "size")
    print("| controller | target | code | tables | state | stack |\n|---|---|---|---|---|---|")
    counted = {}
    for name, changes in CASES.items():
        with tempfile.TemporaryDirectory() as path:
            folder = Path(path)
            write_c(folder, None, controller_code("nutation", RUN | changes))
            for kind, (compiler, flags, size) in kinds.items():
                numbers = " | ".join(map(str, sizes(folder, compiler, flags, size)))
                print(f"| {name} | {kind} | {numbers} |", flush=True)
            counted[name] = operations(folder, changes)
    print("\n| controller | sums | products | divisions | roots | libm | most in a tick |")
    print("|---|---|---|---|---|---|---|")
    for name, rows in counted.items():
        middle = " | ".join(f"{value:.0f}" for value in np.median(rows, axis=0))
        print(f"| {name} | {middle} | {rows.sum(axis=1).max():.0f} |")


if __name__ == "__main__":
    main()
