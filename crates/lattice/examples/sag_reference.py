"""Makes the reference of the example `sag`: an organ under a thousandth of gravity, one end pinned, by quadratic tetrahedra of scikit-fem.

    python3 -m venv /tmp/skfem && /tmp/skfem/bin/pip install scikit-fem meshio
    /tmp/skfem/bin/python crates/lattice/examples/sag_reference.py ORGAN.msh REFERENCE.txt

Linear elasticity; 12 kPa, nu 0.45, 1200 kg/m3, gravity along -z. Pinned are nodes within 8 mm of the node farthest from the middle.
Each line of the output is a node of the organ: 1 or 0 for pinned or not, and its displacement [m]. Prints the mean sag of linear tetrahedra too.
"""

import sys

import meshio
import numpy as np
import skfem
from skfem.helpers import ddot, identity, sym_grad, trace

E, NU, RHO, G = 12e3, 0.45, 1200.0, 9.81e-3
MU, LAMBDA = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))


def solve(mesh, element, points):
    """Displacements of `points` of the mesh, the nodes of the whole edges held."""
    basis = skfem.Basis(mesh, skfem.ElementVector(element))
    stress = lambda e: 2 * MU * e + LAMBDA * trace(e) * identity(e)
    matrix = skfem.BilinearForm(lambda u, v, w: ddot(stress(sym_grad(u)), sym_grad(v))).assemble(basis)
    load = skfem.LinearForm(lambda v, w: -RHO * G * v[2]).assemble(basis)
    pinned = set(points)
    whole = [e for e, ends in enumerate(mesh.edges.T) if ends[0] in pinned and ends[1] in pinned]
    held = basis.nodal_dofs[:, points].ravel()
    if isinstance(element, skfem.ElementTetP2):
        held = np.concatenate([held, basis.edge_dofs[:, whole].ravel()])
    x = skfem.solve(*skfem.condense(matrix, load, D=held))
    return x[basis.nodal_dofs].T, basis.N


organ = meshio.read(sys.argv[1])
mesh = skfem.MeshTet(organ.points.T.copy(), organ.cells_dict["tetra"].T.astype(np.int64))
points = mesh.p.T
end = points[np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1))]
held = np.flatnonzero(np.linalg.norm(points - end, axis=1) < 8e-3)
linear, _ = solve(mesh, skfem.ElementTetP1(), held)
quadratic, unknowns = solve(mesh, skfem.ElementTetP2(), held)
print(f"{mesh.nvertices} nodes, {mesh.nelements} elements, {len(held)} pinned; mean sag of linear ones {-1e6 * linear[:, 2].mean():.4f} um, "
      f"of quadratic ones {-1e6 * quadratic[:, 2].mean():.4f} um ({unknowns} unknowns)")
pinned = np.zeros(len(points), dtype=int)
pinned[held] = 1
with open(sys.argv[2], "w") as out:
    out.write(f"# {sys.argv[1]}: pinned, displacement [m]; by scikit-fem {skfem.__version__}\n")
    for flag, u in zip(pinned, quadratic):
        out.write(f"{flag} " + " ".join(f"{x:.10e}" for x in u) + "\n")
