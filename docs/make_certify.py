"""Measure the table of docs/certify.md: python docs/make_certify.py"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

PAGE = Path(__file__).with_name("certify.md")
BEGIN, END = "<!-- measured -->\n", "<!-- end of measured -->"

#: Bounds below this number of ulps are those of coordinates that a step does not change.
UNCHANGED = 1e-10
#: Systems of different kinds, with the options of their certificates and what the table says of them.
ROWS = {
    "pendulum_euler": ("explicit", []),
    "pendulum": ("Newton, canonical, order 6", []),
    "predator_prey": ("Newton, log-canonical", []),
    "rigid_body": ("Newton, so(3)*, order 6, gauge", []),
    "satellite": ("Newton, 9 coordinates", []),
    "toda3": ("Newton, exponential", []),
    "kepler": ("Newton, order 6", []),
    "duffing": ("Newton, with the time", []),
    "seasonal_predator_prey": ("Newton, with the time", []),
    "thruster_body": ("Newton, 5 stages, forces", []),
    "satellite_wheels": ("25 flows, 15 coordinates", []),
    "kepler_eccentric": (
        "35 flows, monitor; box ± 10⁻⁴",
        [f"--box={box}" for box in ("q1=0.0499:0.0501", "q2=-1e-4:1e-4", "p1=-1e-4:1e-4", "p2=6.2449:6.2451")],
    ),
    "charged_particle": ("path, 6 coordinates", ["--samples=10"]),
    "guiding_centre": ("path, 5 stages", ["--samples=5"]),
    "kowalevski_gauss": ("Gauss, order 16, step 0.05", ["--step=0.05"]),
}


def main() -> None:
    """Write the table into the page."""
    lines = [
        "| system | kind of step | boxes | seconds | bound in ulps | bound / observed |",
        "|---|---|---|---|---|---|",
    ]
    for name, (kind, options) in ROWS.items():
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "phigen", "certify", name, *options, "-o", folder, "--json", "-q"]
            document = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        pairs = zip(document["bound"], document["observed"], strict=True)
        ratios = [bound / observed for bound, observed in pairs if observed > 0]
        ulps = [u for u in document["bound_in_ulps"] if u > UNCHANGED]
        row = (name, kind, document["boxes"], f"{document['seconds']:.2f}", _range(ulps), _range(ratios))
        lines.append(f"| {' | '.join(map(str, row))} |")
        print(lines[-1], flush=True)
    before, _, following = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = following.partition(END)[2]
    PAGE.write_text(before + BEGIN + "\n" + "\n".join(lines) + "\n\n" + END + after, encoding="utf-8")


def _range(values: list[float]) -> str:
    return f"{min(values):.2g} – {max(values):.2g}"


if __name__ == "__main__":
    main()
