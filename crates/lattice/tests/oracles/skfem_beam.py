"""Makes ../fixtures/skfem_beam.txt: a clamped beam under its weight, by scikit-fem, for tests/scikit_fem.rs.

    python3 -m venv /tmp/skfem && /tmp/skfem/bin/pip install scikit-fem
    /tmp/skfem/bin/python crates/lattice/tests/oracles/skfem_beam.py

A beam of 24 x 8 x 6 mm along x, held at x = 0, under a thousandth of gravity along -z; 12 kPa, 1200 kg/m3, Poisson's ratios of 0.3 to 0.499.
Linear elasticity. Displacements are quadratic on tetrahedra, pressures linear and continuous (Taylor and Hood), so that no ratio locks. Written are
the displacements of a grid of probes on meshes of 1 mm, and the largest difference from those on meshes of 1.5 mm.
"""

from pathlib import Path

import numpy as np
import skfem
from scipy.sparse import bmat
from skfem.helpers import ddot, div, sym_grad

SIZE = np.array([24e-3, 8e-3, 6e-3])
E, RHO, G = 12e3, 1200.0, 9.81e-3
NUS = [0.3, 0.45, 0.49, 0.499]
PROBES = np.array([(x, y, z) for x in (8e-3, 16e-3, 24e-3) for y in (0.0, 4e-3, 8e-3) for z in (0.0, 3e-3, 6e-3)]).T


def solve(nu, edge):
    mu, bulk = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    lam = bulk - 2 * mu / 3
    ticks = [np.linspace(0.0, side, round(side / edge) + 1) for side in SIZE]
    mesh = skfem.MeshTet.init_tensor(*ticks)
    moved = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=4)
    pressed = moved.with_element(skfem.ElementTetP1())
    a = skfem.BilinearForm(lambda u, v, w: 2 * mu * ddot(sym_grad(u), sym_grad(v))).assemble(moved)
    b = skfem.BilinearForm(lambda u, q, w: div(u) * q).assemble(moved, pressed)
    c = skfem.BilinearForm(lambda p, q, w: p * q / lam).assemble(pressed)
    load = skfem.LinearForm(lambda v, w: -RHO * G * v[2]).assemble(moved)
    matrix = bmat([[a, b.T], [b, -c]], "csr")
    held = moved.get_dofs(lambda x: np.isclose(x[0], 0.0)).all()
    x = skfem.solve(*skfem.condense(matrix, np.concatenate([load, np.zeros(pressed.N)]), D=held))
    values = moved.probes(PROBES) @ x[: moved.N]
    return values.reshape(3, -1)


path = Path(__file__).resolve().parent.parent / "fixtures" / "skfem_beam.txt"
with path.open("w") as out:
    out.write(f"# Probes [m] and their displacements [m]; made by tests/oracles/skfem_beam.py with scikit-fem {skfem.__version__}\n")
    for nu in NUS:
        fine, coarse = solve(nu, 1e-3), solve(nu, 1.5e-3)
        change = np.abs(fine - coarse).max() / np.abs(fine).max()
        print(f"nu {nu}: largest displacement {1e3 * np.abs(fine).max():.6f} mm, {change:.1e} from the coarser mesh's")
        out.write(f"nu {nu} change {change:.1e}\n")
        for p, u in zip(PROBES.T, fine.T):
            out.write(" ".join(f"{x:.10e}" for x in [*p, *u]) + "\n")
