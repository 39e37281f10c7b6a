"""What clients say of themselves: who is there, and who operates."""

from __future__ import annotations

from spheretwin.twin.bench.command import By, Text, command
from spheretwin.twin.bench.operators import Operators

HELLO = command("hello", Operators.see, by=By.CLIENT)
BEAT = command("beat", Operators.see, by=By.CLIENT)
ASK = command("ask", Operators.ask, by=By.CLIENT)
LEAVE = command("leave", Operators.leave, by=By.CLIENT)
GRANT = command("grant", Operators.grant, by=By.CLIENT, arguments={"to": (Text, ...)})
