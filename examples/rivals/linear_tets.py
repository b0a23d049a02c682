#!/usr/bin/env python3
"""A rival for `palpate accuracy --rival`: linear elastic tetrahedra, contact with a sphere, in numpy alone.

    palpate accuracy --scenes block --rival examples/rivals/linear_tets.py --rival-mesh-mm 8 -o accuracy

Reads FOLDER/push.json and writes displacements.csv, forces.csv and times.csv beside it (docs/accuracy.md has the keys and
columns). What the nodes that the sphere may meet do to all others is solved for beforehand, as dense matrices: small meshes
only. Each tick then finds the forces at those nodes that keep them out of the sphere.
"""
import json
import os
import pathlib
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the chart is of one core
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np  # noqa: E402

MOST_NODES = 6000  # a dense matrix of 18,000 x 18,000 takes 2.6 GB
UNLOCKED = 0.45  # linear tetrahedra get too stiff beyond this Poisson's ratio
REACH = 3e-3  # beyond the sphere's radius, from its path to nodes that it may meet [m]


def stiffness(points, tets, youngs, poisson):
    """The body's stiffness matrix (3 n x 3 n) [N/m]."""
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    volume = np.linalg.det(edges) / 6
    inner = np.linalg.inv(edges).transpose(0, 2, 1)  # gradients of the last three shape functions, one per row
    gradient = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
    lam = youngs * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = youngs / (2 * (1 + poisson))
    # Block (a, b): lambda a b^T + mu (b a^T + a.b I), a and b the gradients.
    outer = np.einsum("tai,tbj->tabij", gradient, gradient)
    dot = np.einsum("tai,tbi->tab", gradient, gradient)
    block = lam[:, None, None, None, None] * outer + mu[:, None, None, None, None] * (
        outer.transpose(0, 1, 2, 4, 3) + dot[..., None, None] * np.eye(3)
    )
    block *= volume[:, None, None, None, None]
    matrix = np.zeros((len(points), 3, len(points), 3))
    for a in range(4):
        for b in range(4):
            np.add.at(matrix, (tets[:, a], slice(None), tets[:, b]), block[:, a, b])
    return matrix.reshape(3 * len(points), 3 * len(points))


def candidates(push, points, free):
    """Nodes of the surface, not held, that the sphere may meet."""
    surface = np.zeros(len(points), bool)
    surface[np.unique(push["surface_triangles"])] = True
    centres = np.array(push["tool_centre_m"])[::10]
    distance = np.linalg.norm(points[:, None] - centres[None], axis=2).min(axis=1)
    return np.flatnonzero(surface & free & (distance < push["tool"]["radius_m"] + REACH))


def pushes(compliance, gap):
    """Forces f >= 0 with gap + compliance f >= 0, and one of both 0 at each node: an active set."""
    force = np.zeros(len(gap))
    active = gap < 0
    for _ in range(50):
        force[:] = 0
        force[active] = np.linalg.solve(compliance[np.ix_(active, active)], -gap[active])
        wanted = (active & (force > 0)) | (~active & (gap + compliance @ force < -1e-12))
        if (wanted == active).all():
            break
        active = wanted
    return np.maximum(force, 0)


def contact(at_rest, centre, radius, response, u):
    """Displacements of the candidates (k x 3) and the forces on them (k x 3) for a sphere there, going on from `u`."""
    k = len(at_rest)
    force = np.zeros((k, 3))
    for _ in range(4):  # the sphere's normals turn with the nodes
        way = at_rest + u - centre
        normal = way / np.linalg.norm(way, axis=1, keepdims=True)
        gap = np.einsum("ki,ki->k", at_rest - centre, normal) - radius
        along = np.einsum("ai,aibj,bj->ab", normal, response.reshape(k, 3, k, 3), normal)
        force = pushes(along, gap)[:, None] * normal
        u = (response @ force.reshape(-1)).reshape(k, 3)
    return u, force


def main(folder):
    push = json.loads((folder / "push.json").read_text())
    points, tets = np.array(push["points_m"]), np.array(push["tets"])
    if len(points) > MOST_NODES:
        sys.exit(f"linear_tets: {len(points)} nodes: {MOST_NODES} are the most; take a larger --rival-mesh-mm")
    own = np.array(push["tet_material"])
    youngs = np.array([m["youngs_modulus_pa"] for m in push["materials"]])[own]
    poisson = np.minimum(np.array([m["poisson_ratio"] for m in push["materials"]])[own], UNLOCKED)
    free = np.ones(len(points), bool)
    free[push["held_points"]] = False
    nodes = candidates(push, points, free)

    # Column of every candidate's force: displacements of all free nodes.
    unknown = np.flatnonzero(np.repeat(free, 3))
    place = np.full(3 * len(points), -1)
    place[unknown] = np.arange(len(unknown))
    matrix = stiffness(points, tets, youngs, poisson)[np.ix_(unknown, unknown)]
    driven = place[(3 * nodes[:, None] + np.arange(3)).reshape(-1)]
    unit = np.zeros((len(unknown), len(driven)))
    unit[driven, np.arange(len(driven))] = 1
    columns = np.linalg.solve(matrix, unit)
    response = columns[driven]

    looks = set(push["look_ticks"])
    u, seconds, fields, forces = np.zeros((len(nodes), 3)), [], [], []
    for tick, centre in enumerate(np.array(push["tool_centre_m"])):
        start = time.process_time()
        u, force = contact(points[nodes], centre, push["tool"]["radius_m"], response, u)
        if force.any():
            seconds.append(max(time.process_time() - start, 1e-9))
        if tick in looks:
            field = np.zeros(3 * len(points))
            field[unknown] = columns @ force.reshape(-1)
            fields.append(field.reshape(-1, 3))
            forces.append(-force.sum(axis=0))  # on the tool
    table = {"fmt": "%.9g", "delimiter": ",", "comments": ""}
    np.savetxt(folder / "displacements.csv", np.concatenate(fields), header="ux_m,uy_m,uz_m", **table)
    np.savetxt(folder / "forces.csv", forces, header="fx_n,fy_n,fz_n", **table)
    np.savetxt(folder / "times.csv", seconds, header="processor_s", **table)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
