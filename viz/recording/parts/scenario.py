"""All that the run depends on: as a text for people, and as facts for whoever reads the recording back."""

from __future__ import annotations

import rerun as rr

from spheretwin.models.telemetry.facts import RunFacts
from spheretwin.viz.layout.paths import SCENARIO
from spheretwin.viz.recording.parts.described import facts_as_json
from spheretwin.viz.recording.parts.part import Part


class ScenarioText(Part):
    """The resolved scenario."""

    def begin(self, recording: rr.RecordingStream) -> None:
        """Log text and facts."""
        facts = self.subject.facts
        recording.send_recording_name(f"{facts.name}, {facts.law}")
        text = rr.TextDocument(_as_markdown(facts), media_type=rr.MediaType.MARKDOWN)
        recording.log(SCENARIO, text, static=True)
        recording.log(SCENARIO, facts_as_json(facts, self.subject.rate_Hz), static=True)


def _as_markdown(facts: RunFacts) -> str:
    """A table for each section."""
    lines = [f"# {facts.name}", "", facts.description, ""]
    for title, fields in facts.sections.items():
        lines += [f"## {title}", "", "| field | value |", "|---|---|"]
        lines += [f"| {key} | {'' if value is None else value} |" for key, value in fields.items()]
        lines.append("")
    return "\n".join(lines)
