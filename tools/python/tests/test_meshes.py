"""Meshes: Scene.add_mesh against an implementation in NumPy, files of each format, bad ones."""
import itertools
import json
import struct

import msim
import numpy as np
import pytest

TOLERANCE = 1e-6  # of the diagonal


def clean(x, faces):
    """Vertices and faces without defects by the rules of mesh.h, and the counts of repairs."""
    used = np.zeros(len(x), bool)
    used[faces.ravel()] = True
    low, high = x[used].min(0), x[used].max(0)
    tolerance = TOLERANCE * np.linalg.norm(high - low)
    representative, kept = np.arange(len(x)), []
    counts = dict(equal_vertices=0, near_vertices=0)
    for v in np.flatnonzero(used):
        near = [r for r in kept if np.linalg.norm(x[v] - x[r]) <= tolerance]
        if not near:
            kept.append(v)
            continue
        representative[v] = min(near)
        counts["equal_vertices" if (x[v] == x[min(near)]).all() else "near_vertices"] += 1
    corners = representative[faces]
    whole = [f for f in corners if len(set(f)) == 3]
    counts["degenerate_faces"] = len(corners) - len(whole)
    single = {}
    for f in whole:
        single.setdefault(frozenset(f.tolist()), f)
    counts["duplicate_faces"] = len(whole) - len(single)
    corners = np.array(list(single.values()), int).reshape(-1, 3)
    left = np.unique(corners)
    counts["unused_vertices"] = (len(x) - len(left) - counts["equal_vertices"]
                                 - counts["near_vertices"])
    number = np.full(len(x), -1)
    number[left] = np.arange(len(left))
    return x[left], number[corners], counts


def edges_of(corners):
    """{(i, j): faces}"""
    edges = {}
    for f, (a, b, c) in enumerate(corners.tolist()):
        for i, j in ((a, b), (b, c), (c, a)):
            edges.setdefault((min(i, j), max(i, j)), []).append(f)
    return edges


def random_mesh(rng):
    """Random triangles, some degenerate, duplicate or turned, of vertices of which some are near."""
    n, m = rng.integers(4, 40), rng.integers(1, 80)
    x = rng.normal(size=(n, 3)) * 10.0 ** rng.integers(-3, 4) + rng.normal(size=3)
    diagonal = np.linalg.norm(np.ptp(x, axis=0))
    for v in range(1, n):
        if rng.random() < 0.3:
            x[v] = x[rng.integers(v)] + rng.choice([0, 2e-7, 6e-6]) * diagonal * rng.normal(size=3) / 3
    faces = rng.integers(n, size=(m, 3))
    for f in range(1, m):
        if rng.random() < 0.2:
            faces[f] = rng.permutation(faces[rng.integers(f)])
    return x, faces.astype(np.int32)


@pytest.mark.parametrize("seed", range(150))
def test_random_meshes(seed):
    rng = np.random.default_rng(seed)
    x, faces = random_mesh(rng)
    at, corners, counts = clean(x, faces)
    scene = msim.Scene()
    if not len(corners):
        with pytest.raises(msim.ArgumentError):
            scene.add_mesh(x, faces, mass=1, k=1)
        return
    assert scene.add_mesh(x, faces, mass=2, k=3, bend=5, damping=0.5) == range(len(at))
    assert (scene.x == at).all()
    assert (scene.mass == 2 / len(at)).all()
    edges = edges_of(corners)
    stiff = sorted(edges)
    bends = [sorted(set(corners[f].tolist()) - set(e) for f in edges[e]) for e in stiff
             if len(edges[e]) == 2]
    assert scene.ij[:len(stiff)].tolist() == [list(e) for e in stiff]
    assert (scene.k == [3] * len(stiff) + [5] * len(bends)).all()
    found = [sorted(pair) for pair in scene.ij[len(stiff):].tolist()]
    assert found == [sorted(v for one in b for v in one) for b in bends]
    assert np.allclose(scene.rest, np.linalg.norm(at[scene.ij[:, 0]] - at[scene.ij[:, 1]], axis=1),
                       rtol=1e-14)
    repairs = scene.mesh_repairs
    for key, count in counts.items():
        assert repairs[key] == count, key
    assert repairs["open_edges"] == sum(len(f) == 1 for f in edges.values())
    assert repairs["nonmanifold_edges"] == sum(len(f) > 2 for f in edges.values())
    check_orientation(scene.faces, corners, edges, repairs["turned_faces"])


def check_orientation(faces, corners, edges, turned):
    """Only corners 1 and 2 change; parts that can be oriented are, and at most half of each turns."""
    changed = (faces != corners).any(1)
    assert (faces[changed] == corners[changed][:, [0, 2, 1]]).all()
    assert changed.sum() == turned
    directed = {(f[c], f[(c + 1) % 3]) for f in faces.tolist() for c in range(3)}
    part = list(range(len(faces)))
    for pair in edges.values():
        if len(pair) == 2:
            a, b = part[pair[0]], part[pair[1]]
            part = [a if p == b else p for p in part]
    for name in set(part):
        members = [f for f in range(len(part)) if part[f] == name]
        assert 2 * changed[members].sum() <= len(members)
    bad = {part[pair[0]] for (i, j), pair in edges.items()
           if len(pair) == 2 and not {(i, j), (j, i)} <= directed}
    for name in bad:  # no choice of orientations would do
        members = [f for f in range(len(part)) if part[f] == name]
        assert not orientable(corners, edges, members)


def orientable(corners, edges, members):
    sign, inside = {members[0]: 1}, set(members)
    stack = [members[0]]
    around = {f: [] for f in members}
    for (i, j), pair in edges.items():
        if len(pair) == 2 and pair[0] in inside:
            rings = [corners[f].tolist() for f in pair]
            ways = [(ring.index(j) - ring.index(i)) % 3 == 1 for ring in rings]
            same = -1 if ways[0] == ways[1] else 1
            around[pair[0]].append((pair[1], same))
            around[pair[1]].append((pair[0], same))
    while stack:
        f = stack.pop()
        for g, same in around[f]:
            if g not in sign:
                sign[g] = sign[f] * same
                stack.append(g)
            elif sign[g] != sign[f] * same:
                return False
    return True


# -- filled bodies --------------------------------------------------------------------------------

def sphere(depth, rng, bumps=0.3):
    """An icosahedron, split `depth` times, stretched and with bumps."""
    t = (1 + 5 ** 0.5) / 2
    v = [(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0), (0, -1, t), (0, 1, t), (0, -1, -t),
         (0, 1, -t), (t, 0, -1), (t, 0, 1), (-t, 0, -1), (-t, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
             (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
             (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    v = [np.array(p) / np.linalg.norm(p) for p in v]
    for _ in range(depth):
        middle, split = {}, []
        for f in faces:
            m = []
            for a, b in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0])):
                key = frozenset((a, b))
                if key not in middle:
                    middle[key] = len(v)
                    p = v[a] + v[b]
                    v.append(p / np.linalg.norm(p))
                m.append(middle[key])
            split += [(f[0], m[0], m[2]), (f[1], m[1], m[0]), (f[2], m[2], m[1]), tuple(m)]
        faces = split
    x = np.array(v)
    waves = rng.normal(size=(4, 3)) * 2
    x = x * (1 + bumps * np.sin(x @ waves.T + rng.uniform(0, 6, 4)).mean(1))[:, None]
    x = x * rng.uniform(0.5, 1.5, 3) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return x + rng.normal(size=3), np.array(faces, np.int32)


def winding(points, x, faces):
    """Generalised winding numbers: solid angles (Van Oosterom and Strackee 1983) over 4 pi."""
    total = np.zeros(len(points))
    for f in faces:
        a, b, c = (x[v] - points for v in f)
        la, lb, lc = (np.linalg.norm(p, axis=1) for p in (a, b, c))
        top = np.einsum("ij,ij->i", a, np.cross(b, c))
        bottom = (la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb)
        total += 2 * np.arctan2(top, bottom)
    return total / (4 * np.pi)


def distance(points, x, faces):
    """From the nearest face: minimum over barycentric projections and edges."""
    least = np.full(len(points), np.inf)
    for f in faces:
        a, b, c = x[f]
        normal = np.cross(b - a, c - a)
        q = points - np.outer((points - a) @ normal / (normal @ normal), normal)
        weights = np.stack([np.cross(c - b, q - b) @ normal, np.cross(a - c, q - c) @ normal,
                            np.cross(b - a, q - a) @ normal])
        d = np.where((weights >= 0).all(0), np.linalg.norm(points - q, axis=1), np.inf)
        for p, e in ((a, b - a), (b, c - b), (c, a - c)):
            t = np.clip((points - p) @ e / (e @ e), 0, 1)
            d = np.minimum(d, np.linalg.norm(points - p - np.outer(t, e), axis=1))
        least = np.minimum(least, d)
    return least


@pytest.mark.parametrize("seed", range(24))
def test_points_inside_random_bodies(seed):
    rng = np.random.default_rng(1000 + seed)
    parts = [sphere(rng.integers(0, 3), rng) for _ in range(rng.integers(1, 4))]
    if seed % 4 == 1:  # all inside out
        parts = [(x, faces[:, ::-1]) for x, faces in parts]
    x = np.concatenate([p[0] for p in parts])
    offsets = np.cumsum([0] + [len(p[0]) for p in parts])
    faces = np.concatenate([f + o for (_, f), o in zip(parts, offsets)])
    extent = np.ptp(x, axis=0)
    s = extent.min() / rng.uniform(4, 10)
    scene = msim.Scene()
    scene.add_mesh(x, faces, mass=1, k=10, fill=s)
    n = np.floor(extent / s).astype(int)
    origin = x.min(0) + (extent - (n - 1) * s) / 2
    grid = np.array(list(itertools.product(*(range(k) for k in n))))
    points = origin + grid * s
    d = distance(points, x, faces)
    inside = (np.abs(winding(points, x, faces)) > 0.5) & (d >= s / 2)
    assert np.abs(d - s / 2).min() > 1e-8 * s  # none is undecided
    assert np.allclose(scene.x[len(x):], points[inside], rtol=0, atol=1e-12)
    check_inner_springs(scene, len(x), edges_of(faces), grid[inside], points[inside],
                        4 if len(parts) == 1 else 1)


def check_inner_springs(scene, n, edges, grid, points, ties):
    """The lattice has the springs of its cells, within a part; each vertex is tied as mesh.h says."""
    ij = scene.ij[len(edges):]
    inner = ij[(ij >= n).all(1)] - n
    steps = np.abs(grid[inner[:, 0]] - grid[inner[:, 1]])
    assert (steps.max(1) == 1).all()
    assert len(np.unique(np.sort(inner, axis=1), axis=0)) == len(inner)
    tied = {}
    for i, j in ij[(ij < n).any(1)].tolist():
        tied.setdefault(i, []).append(j - n)
    assert sorted(tied) == list(range(n))
    for to in tied.values():
        assert len(to) >= min(ties, len(points))
        assert len(set(to)) == len(to)


def test_the_body_is_one():
    """All particles of a part are connected, and move as one."""
    x, faces = sphere(3, np.random.default_rng(3))
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_mesh(x, faces, mass=1, k=1000, fill=True, damping=0.1)
    sim = msim.Sim(scene, integrator="implicit-euler", h=1 / 60)
    sim.step(10)
    fallen = sim.x - scene.x
    assert np.allclose(fallen, fallen[0], atol=1e-9)


# -- files ----------------------------------------------------------------------------------------

CUBE = np.array(list(itertools.product((0, 1), repeat=3)), float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))], np.int32)


def write_obj(path, x=CUBE, polygons=QUADS):
    path.write_text("".join(f"v {a} {b} {c}\n" for a, b, c in x.tolist())
                    + "".join("f " + " ".join(str(i + 1) for i in p) + "\n" for p in polygons))


def write_ply(path, x=CUBE, polygons=QUADS):
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex {len(x)}\nproperty float x\n"
                    "property float y\nproperty float z\n"
                    f"element face {len(polygons)}\nproperty list uchar int vertex_indices\n"
                    "end_header\n"
                    + "".join(f"{a} {b} {c}\n" for a, b, c in x.tolist())
                    + "".join(" ".join(map(str, (len(p), *p))) + "\n" for p in polygons))


def write_stl(path, x=CUBE, faces=TRIANGLES):
    data = b"\0" * 80 + struct.pack("<I", len(faces))
    for f in faces:
        data += struct.pack("<12fH", 0, 0, 0, *x[f].ravel(), 0)
    path.write_bytes(data)


def write_ascii_stl(path, x=CUBE, faces=TRIANGLES):
    path.write_text("solid cube\n" + "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join("vertex {} {} {}\n".format(*x[v]) for v in f)
        + "endloop\nendfacet\n" for f in faces) + "endsolid cube\n")


def gltf(x, faces, uri=None, nodes=None):
    data = x.astype("<f4").tobytes() + faces.astype("<u2").tobytes()
    buffer = {"byteLength": len(data), **({"uri": uri} if uri else {})}
    tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": nodes or [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "buffers": [buffer],
            "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 12 * len(x)},
                            {"buffer": 0, "byteOffset": 12 * len(x),
                             "byteLength": 6 * len(faces)}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(x), "type": "VEC3",
                           "min": x.min(0).tolist(), "max": x.max(0).tolist()},
                          {"bufferView": 1, "componentType": 5123, "count": 3 * len(faces),
                           "type": "SCALAR"}]}
    return tree, data


def write_gltf(path, x=CUBE, faces=TRIANGLES, nodes=None):
    tree, data = gltf(x, faces, path.stem + ".bin", nodes)
    path.with_suffix(".bin").write_bytes(data)
    path.write_text(json.dumps(tree))


def write_glb(path, x=CUBE, faces=TRIANGLES):
    tree, data = gltf(x, faces)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
                     + struct.pack("<I4s", len(text), b"JSON") + text
                     + struct.pack("<I4s", len(data), b"BIN\0") + data)


WRITERS = {"obj": write_obj, "ply": write_ply, "stl": write_stl, "ascii.stl": write_ascii_stl,
           "gltf": write_gltf, "glb": write_glb, "OBJ": write_obj, "Stl": write_stl}


def reads_meshes():
    return {"assimp"} & {i.name for i in msim.importers() if i.available}


needs_assimp = pytest.mark.skipif(not hasattr(msim, "importers") or not reads_meshes(),
                                  reason="the plugin assimp is missing")


def scene_with(path, **keys):
    return {"msim": 1, "objects": [{"type": "mesh", "file": str(path), "mass": 8, "k": 10, **keys}]}


@needs_assimp
@pytest.mark.parametrize("name", WRITERS)
def test_each_format(tmp_path, name):
    (tmp_path / "shapes").mkdir()
    WRITERS[name](tmp_path / "shapes" / f"cube.{name}")
    (tmp_path / "s.json").write_text(json.dumps(scene_with(f"shapes/cube.{name}", fill=0.15,
                                                           bend=2, translate=[1, 2, 3], scale=0.5)))
    scene = msim.Scene.load(tmp_path / "s.json")
    assert len(scene) == 8 + 27
    assert {tuple(p) for p in scene.x[:8].tolist()} == {
        tuple(p) for p in (CUBE * 0.5 + [1, 2, 3]).tolist()}
    assert len(scene.faces) == 12
    assert (scene.mass == 8 / 35).all()
    assert not any(count for key, count in scene.mesh_repairs.items() if key != "equal_vertices")
    # files with indices of vertices keep their numbers
    if name in ("ply", "gltf", "glb"):
        assert (scene.x[:8] == CUBE * 0.5 + [1, 2, 3]).all()
    copy = msim.Scene.loads(scene.dumps())
    assert (copy.x == scene.x).all() and (copy.ij == scene.ij).all()
    assert (copy.rest == scene.rest).all() and (copy.faces == scene.faces).all()
    scene.save(tmp_path / "elsewhere.json")
    assert len(msim.Scene.load(tmp_path / "elsewhere.json")) == 35


@needs_assimp
def test_nodes_are_applied(tmp_path):
    """Translation, rotation and scale of nested nodes; a mirrored one keeps its outside."""
    nodes = [{"children": [1], "translation": [0, 0, 5], "rotation": [0, 0, 0.6, 0.8]},
             {"mesh": 0, "scale": [-2, 1, 1]}]
    write_gltf(tmp_path / "cube.gltf", nodes=nodes)
    scene = msim.Scene()
    scene.add_mesh(file=tmp_path / "cube.gltf", mass=1, k=1)
    c, s = 0.8 ** 2 - 0.6 ** 2, 2 * 0.8 * 0.6
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert np.allclose(scene.x, CUBE * [-2, 1, 1] @ turn.T + [0, 0, 5], atol=1e-6)
    a, b, c = (scene.x[scene.faces[:, i]] - scene.x.mean(0) for i in range(3))
    assert (np.einsum("ij,ij->i", a, np.cross(b, c)) > 0).all()
    assert scene.mesh_repairs["turned_faces"] == 0


@needs_assimp
def test_polygons_become_triangles(tmp_path):
    """An L, not convex: its area remains."""
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]], float)
    write_obj(tmp_path / "l.obj", corners, [range(6)])
    scene = msim.Scene()
    scene.add_mesh(file=tmp_path / "l.obj", mass=1, k=1)
    a, b, c = (scene.x[scene.faces[:, i]] for i in range(3))
    assert len(scene.faces) == 4
    assert np.cross(b - a, c - a)[:, 2].sum() == pytest.approx(6)


def bad_files(folder):
    """Name, how it is written, words of the message."""
    def put(name, data):
        path = folder / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return path

    for name, writer in WRITERS.items():
        writer(folder / f"whole.{name}")
    rng = np.random.default_rng(0)
    for ending in ("obj", "ply", "stl", "gltf", "glb"):
        yield put(f"empty.{ending}", b"")
        yield put(f"garbage.{ending}", rng.bytes(5000))
        yield put(f"blank.{ending}", b" \n" * 100)
        yield folder / f"missing.{ending}"
        (folder / f"folder.{ending}").mkdir()
        yield folder / f"folder.{ending}"
        whole = (folder / f"whole.{ending}").read_bytes()
        for part in (0.1, 0.5, 0.9):
            yield put(f"cut{part}.{ending}", whole[:int(len(whole) * part)])
    yield put("points.obj", "v 0 0 0\n" * 5)
    yield put("one.obj", "v 1 2 3\nf 1 1 1\n")
    yield put("line.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n")
    yield put("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    yield put("inf.obj", "v 0 0 0\nv 1e400 0 0\nv 0 1 0\nf 1 2 3\n")
    yield put("beyond.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    yield put("zero.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n")
    yield put("cube.xyz", "v 0 0 0\n")
    yield put("cube", "v 0 0 0\n")
    yield put("cube.json", "{}")
    yield put("many.ply", (folder / "whole.ply").read_bytes().replace(b"vertex 8", b"vertex 4000000000"))
    yield put("more.stl", (folder / "whole.stl").read_bytes()[:80] + b"\xff" * 4)
    write_gltf(folder / "nobuffer.gltf")
    (folder / "nobuffer.bin").unlink()
    yield folder / "nobuffer.gltf"


@needs_assimp
def test_bad_files(tmp_path, capfd):
    """Each is refused with one sentence that names it, or is a mesh as far as it goes."""
    scene = msim.Scene()
    count = 0
    for path in bad_files(tmp_path):
        before = len(scene)
        try:
            scene.add_mesh(file=path, mass=1, k=1)
        except msim.Error as error:
            text = str(error)
            assert path.name in text, text
            assert "\n" not in text
            assert len(scene) == before
            count += 1
        else:
            assert path.name.startswith("cut") or path.name in ("beyond.obj", "zero.obj"), path
    assert count >= 30
    assert capfd.readouterr() == ("", "")


@needs_assimp
def test_a_mesh_is_no_scene(tmp_path):
    write_obj(tmp_path / "cube.obj")
    with pytest.raises(msim.Error, match="it is a mesh, not a scene"):
        msim.Scene.load(tmp_path / "cube.obj")
    with pytest.raises(msim.Error, match="no masses and springs"):
        scene = msim.Scene()
        scene.add_mesh(CUBE, TRIANGLES, mass=1, k=1)
        scene.save(tmp_path / "saved.obj")


def test_planes_constrain(tmp_path):
    scene = msim.Scene()
    assert scene.planes_constrain is False
    scene.add_mesh(vertices=CUBE, faces=TRIANGLES, mass=1, k=1)
    assert scene.planes_constrain is True
    scene.save(tmp_path / "a.json")
    assert msim.Scene.load(tmp_path / "a.json").planes_constrain is True
    scene.planes_constrain = False
    assert scene.planes_constrain is False
    with pytest.raises((TypeError, ValueError), match="planes_constrain"):
        scene.planes_constrain = "yes"


def test_arguments():
    scene = msim.Scene()
    for keys, words in (({}, "or a file"), ({"vertices": CUBE}, "or a file"),
                        ({"vertices": CUBE, "faces": TRIANGLES, "file": "a.obj"}, "or a file"),
                        ({"vertices": CUBE, "faces": TRIANGLES, "fill": 0}, "fill must be"),
                        ({"vertices": CUBE, "faces": TRIANGLES, "pinned": "corners"}, "is a name"),
                        ({"vertices": CUBE, "faces": TRIANGLES[:-1], "fill": 0.2},
                         "3 are open")):
        with pytest.raises(msim.Error, match=words):
            scene.add_mesh(**keys, mass=1, k=1)
    assert len(scene) == 0
