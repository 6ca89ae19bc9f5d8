"""Makes ../fixtures/skfem_block.txt: a block that hangs from a wall, by scikit-fem, for tests/scikit_fem.rs.

    python3 -m venv /tmp/skfem && /tmp/skfem/bin/pip install scikit-fem
    /tmp/skfem/bin/python crates/tissue-reference/tests/oracles/skfem_block.py

A block of 5 x 4 x 4 cubes of 3 mm, six linear tetrahedra a cube around its main diagonal, held at x = 0, under gravity along -z; 12 kPa, nu 0.45,
1200 kg/m3. Nodes are numbered x first, then y, then z. Three solutions, one block of the file each: linear elasticity under gravity / 10,000, stable
neo-Hookean and St. Venant-Kirchhoff tissue under full gravity (Newton's method, load in parts). Then two by quadratic tetrahedra, at the corners:
linear elasticity under gravity / 10,000 and stable neo-Hookean tissue under full gravity.
"""

from pathlib import Path

import numpy as np
import skfem
from skfem.helpers import ddot, grad, identity, sym_grad, trace, transpose

CELLS, EDGE = (5, 4, 4), 3e-3
E, NU, RHO, G = 12e3, 0.45, 1200.0, 9.81
MU, LAMBDA = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))


def block():
    nx, ny, nz = CELLS
    index = lambda i, j, k: (k * (ny + 1) + j) * (nx + 1) + i
    nodes = [(i, j, k) for k in range(nz + 1) for j in range(ny + 1) for i in range(nx + 1)]
    tets = []
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                corner = lambda c: index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1))
                for a, b in [(1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)]:
                    tets.append((corner(0), corner(a), corner(b), corner(7)))
    return skfem.MeshTet(EDGE * np.array(nodes, dtype=float).T, np.array(tets).T)


def matmul(a, b):
    return np.einsum("ij...,jk...->ik...", a, b)


def cofactor(f):
    return np.stack([np.cross(f[:, 1], f[:, 2], axis=0), np.cross(f[:, 2], f[:, 0], axis=0), np.cross(f[:, 0], f[:, 1], axis=0)], axis=1)


def cofactor_change(f, d):
    c = lambda a, b: np.cross(a, b, axis=0)
    return np.stack([c(d[:, 1], f[:, 2]) + c(f[:, 1], d[:, 2]), c(d[:, 2], f[:, 0]) + c(f[:, 2], d[:, 0]), c(d[:, 0], f[:, 1]) + c(f[:, 0], d[:, 1])], axis=1)


def stable_neo_hookean(f, d):
    """Stress, and its change when F changes by d: mu F + lambda' (J - alpha) cof F."""
    volume = LAMBDA + MU
    cof = cofactor(f)
    slope = volume * (np.einsum("i...,i...->...", f[:, 0], cof[:, 0]) - 1.0 - MU / volume)
    if d is None:
        return MU * f + slope * cof
    return MU * d + volume * ddot(cof, d) * cof + slope * cofactor_change(f, d)


def st_venant_kirchhoff(f, d):
    strain = 0.5 * (matmul(transpose(f), f) - identity(f))
    second = lambda e: 2 * MU * e + LAMBDA * trace(e) * identity(f)
    if d is None:
        return matmul(f, second(strain))
    product = matmul(transpose(f), d)
    return matmul(d, second(strain)) + matmul(f, second(0.5 * (product + transpose(product))))


mesh = block()


def discretise(element, intorder):
    basis = skfem.Basis(mesh, skfem.ElementVector(element), intorder=intorder)
    held = basis.get_dofs(lambda x: np.isclose(x[0], 0.0))
    return basis, held, skfem.LinearForm(lambda v, w: -RHO * G * v[2]).assemble(basis)


basis, held, load = discretise(skfem.ElementTetP1(), 1)


def linear(share):
    stress = lambda e: 2 * MU * e + LAMBDA * trace(e) * identity(e)
    stiffness = skfem.BilinearForm(lambda u, v, w: ddot(stress(sym_grad(u)), sym_grad(v))).assemble(basis)
    return skfem.solve(*skfem.condense(stiffness, share * load, D=held))


def nonlinear(stress):
    tangent = skfem.BilinearForm(lambda u, v, w: ddot(stress(grad(w["prev"]) + identity(grad(w["prev"])), grad(u)), grad(v)))
    force = skfem.LinearForm(lambda v, w: ddot(stress(grad(w["prev"]) + identity(grad(w["prev"])), None), grad(v)))
    u = basis.zeros()
    free = basis.complement_dofs(held)
    for share in np.linspace(0.1, 1.0, 10):
        for _ in range(30):
            prev = basis.interpolate(u)
            residual = share * load - force.assemble(basis, prev=prev)
            if np.linalg.norm(residual[free]) < 1e-12 * np.linalg.norm(load):
                break
            u = u + skfem.solve(*skfem.condense(tangent.assemble(basis, prev=prev), residual, D=held))
        else:
            raise SystemExit("Newton's method did not converge")
    return u


def write(out, name, u):
    out.write(f"{name}\n")
    for node in range(mesh.nvertices):
        out.write(" ".join(f"{x:.12e}" for x in u[basis.nodal_dofs[:, node]]) + "\n")
    print(f"{name}: largest displacement {1e3 * np.abs(u).max():.6f} mm")


path = Path(__file__).resolve().parent.parent / "fixtures" / "skfem_block.txt"
with path.open("w") as out:
    out.write(f"# Displacements of each node [m]; made by tests/oracles/skfem_block.py with scikit-fem {skfem.__version__}\n")
    write(out, "linear", linear(1e-4))
    write(out, "stable-neo-hookean", nonlinear(stable_neo_hookean))
    write(out, "st-venant-kirchhoff", nonlinear(st_venant_kirchhoff))
    basis, held, load = discretise(skfem.ElementTetP2(), 2)
    write(out, "quadratic-linear", linear(1e-4))
    write(out, "quadratic-stable-neo-hookean", nonlinear(stable_neo_hookean))
