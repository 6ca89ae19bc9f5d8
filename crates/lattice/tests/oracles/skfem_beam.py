"""Makes ../fixtures/skfem_beam.txt: a clamped beam under its weight, by scikit-fem, for tests/scikit_fem.rs.

    python3 -m venv /tmp/skfem && /tmp/skfem/bin/pip install scikit-fem
    /tmp/skfem/bin/python crates/lattice/tests/oracles/skfem_beam.py

A beam of 24 x 8 x 6 mm along x, held at x = 0, under a thousandth of gravity along -z; 12 kPa, 1200 kg/m3, Poisson's ratios of 0.3 to 0.499.
Linear elasticity. Displacements are quadratic on tetrahedra, pressures linear and continuous (Taylor and Hood), so that no ratio locks. Written are
the displacements of a grid of probes on meshes of 1 mm, and the largest difference from those on meshes of 1.5 mm.

Then the same beam under full gravity, at a ratio of 0.45, of corotated and of stable neo-Hookean tissue: Newton's method, load in parts, quadratic
tetrahedra on meshes of 1.6 and 2 mm.
"""

from pathlib import Path

import numpy as np
import skfem
from scipy.sparse import bmat
from skfem.helpers import ddot, div, grad, identity, sym_grad

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


def product(a, b):
    return np.einsum("ij...,jk...->ik...", a, b)


def transposed(a):
    return np.swapaxes(a, 0, 1)


def scaled(number, matrix):
    return number[None, None] * matrix


class Corotated:
    """mu |S - I|^2 + lambda/2 tr(S - I)^2."""

    def __init__(self, f, mu, lam):
        self.f, self.mu, self.lam = f, mu, lam
        u, s, vt = np.linalg.svd(np.moveaxis(f, (0, 1), (-2, -1)))
        if np.linalg.det(u @ vt).min() < 0:
            raise SystemExit("an element is inverted")
        self.r = np.moveaxis(u @ vt, (-2, -1), (0, 1))
        stretch = np.moveaxis(np.swapaxes(vt, -1, -2) @ (s[..., None] * vt), (-2, -1), (0, 1))
        self.trace = np.trace(stretch) - 3.0
        bend = scaled(np.trace(stretch), identity(f)) - stretch
        self.inverse = np.moveaxis(np.linalg.inv(np.moveaxis(bend, (0, 1), (-2, -1))), (-2, -1), (0, 1))

    def stress(self):
        return 2 * self.mu * (self.f - self.r) + self.lam * scaled(self.trace, self.r)

    def change(self, d):
        turned = product(transposed(self.r), d)
        skew = turned - transposed(turned)
        axial = np.stack([skew[2, 1], skew[0, 2], skew[1, 0]])
        w = np.einsum("ij...,j...->i...", self.inverse, axial)
        zero = np.zeros_like(w[0])
        spin = np.array([[zero, -w[2], w[1]], [w[2], zero, -w[0]], [-w[1], w[0], zero]])
        dr = product(self.r, spin)
        return 2 * self.mu * (d - dr) + self.lam * (scaled(np.trace(turned), self.r) + scaled(self.trace, dr))


class StableNeoHookean:
    """mu/2 (|F|^2 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2."""

    def __init__(self, f, mu, lam):
        self.f, self.mu, self.volume = f, mu, lam + mu
        cross = lambda a, b: np.cross(a, b, axis=0)
        self.cofactor = np.stack([cross(f[:, 1], f[:, 2]), cross(f[:, 2], f[:, 0]), cross(f[:, 0], f[:, 1])], axis=1)
        self.slope = self.volume * (np.einsum("i...,i...->...", f[:, 0], self.cofactor[:, 0]) - 1.0) - mu

    def stress(self):
        return self.mu * self.f + scaled(self.slope, self.cofactor)

    def change(self, d):
        c = lambda a, b: np.cross(a, b, axis=0)
        f = self.f
        turn = np.stack([c(d[:, 1], f[:, 2]) + c(f[:, 1], d[:, 2]), c(d[:, 2], f[:, 0]) + c(f[:, 2], d[:, 0]), c(d[:, 0], f[:, 1]) + c(f[:, 0], d[:, 1])], axis=1)
        return self.mu * d + scaled(self.volume * ddot(self.cofactor, d), self.cofactor) + scaled(self.slope, turn)


def bend(law, nu, cells, parts=10):
    mu, bulk = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    mesh = skfem.MeshTet.init_tensor(*[np.linspace(0.0, side, n + 1) for side, n in zip(SIZE, cells)])
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=3)
    load = skfem.LinearForm(lambda v, w: -1e3 * RHO * G * v[2]).assemble(basis)
    held = basis.get_dofs(lambda x: np.isclose(x[0], 0.0))
    free = basis.complement_dofs(held)
    u = basis.zeros()
    for share in np.linspace(1.0 / parts, 1.0, parts):
        for _ in range(30):
            gradient = np.asarray(basis.interpolate(u).grad)
            tissue = law(gradient + identity(gradient), mu, bulk - 2 * mu / 3)
            residual = share * load - skfem.LinearForm(lambda v, w: ddot(tissue.stress(), grad(v))).assemble(basis)
            if np.linalg.norm(residual[free]) < 1e-10 * np.linalg.norm(load):
                break
            tangent = skfem.BilinearForm(lambda v, w, _: ddot(tissue.change(grad(v)), grad(w))).assemble(basis)
            u = u + skfem.solve(*skfem.condense(tangent, residual, D=held))
        else:
            raise SystemExit("Newton's method did not converge")
    return (basis.probes(PROBES) @ u).reshape(3, -1)


path = Path(__file__).resolve().parent.parent / "fixtures" / "skfem_beam.txt"
with path.open("w") as out:
    out.write(f"# Probes [m] and their displacements [m]; made by tests/oracles/skfem_beam.py with scikit-fem {skfem.__version__}\n")

    def write(name, fine, coarse):
        change = np.abs(fine - coarse).max() / np.abs(fine).max()
        print(f"{name}: largest displacement {1e3 * np.abs(fine).max():.6f} mm, {change:.1e} from the coarser mesh's", flush=True)
        out.write(f"{name} change {change:.1e}\n")
        for p, u in zip(PROBES.T, fine.T):
            out.write(" ".join(f"{x:.10e}" for x in [*p, *u]) + "\n")

    for law in (Corotated, StableNeoHookean):
        write(f"bent {law.__name__}", bend(law, 0.45, (15, 5, 4)), bend(law, 0.45, (12, 4, 3)))
    for nu in NUS:
        write(f"nu {nu}", solve(nu, 1e-3), solve(nu, 1.5e-3))
