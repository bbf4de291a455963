"""Mesh files that are whole, damaged or truncated: what the plugin `assimp` makes of them."""
import struct

import support
from cli_support import CliTest

VERTICES = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]

OBJ = ("".join("v %g %g %g\n" % x for x in VERTICES) +
       "".join("f %d %d %d\n" % tuple(i + 1 for i in face) for face in FACES))


def text_stl():
    corners = ["".join("  vertex %g %g %g\n" % VERTICES[i] for i in face) for face in FACES]
    return "solid a\n%sendsolid a\n" % "".join(
        f"facet normal 0 0 0\n outer loop\n{c} endloop\nendfacet\n" for c in corners)


def binary_stl(header=b""):
    corners = [[c for i in face for c in VERTICES[i]] for face in FACES]
    return (header.ljust(80, b"\0") + struct.pack("<I", len(FACES)) +
            b"".join(struct.pack("<12fH", 0, 0, 0, *c, 0) for c in corners))


WHOLE = {
    "text.stl": text_stl(),
    "text_without_line_end.stl": text_stl()[:-1],
    "binary.stl": binary_stl(),
    "binary_like_text.stl": binary_stl(b"solid a"),
    "mesh.obj": OBJ,
    "mesh_without_line_end.obj": OBJ[:-1],
    "mesh_and_line.obj": OBJ + "l 1 2",
    "upper.OBJ": OBJ,
}

DAMAGED = {
    "no_endsolid.stl": (text_stl()[:-11], "truncated"),
    "between_facets.stl": (text_stl()[:text_stl().rindex("facet normal")], "truncated"),
    "within_vertex.stl": (text_stl()[:250], "truncated"),
    "one_face_less.stl": (binary_stl()[:-50], "STL"),
    "within_face.stl": (binary_stl()[:-20], "STL"),
    "like_text_one_face_less.stl": (binary_stl(b"solid a")[:-50], "truncated"),
    "two_corners.obj": (OBJ[:-3], "truncated"),
    "one_corner.OBJ": (OBJ[:-5], "truncated"),
    "two_coordinates.obj": (OBJ + "v 1 2", "truncated"),
    "no_such_vertex.obj": (OBJ + "f 1 2 9\n", "out of range"),
    "no_such_vertex_before.obj": (OBJ + "f -1 -2 -9\n", "out of range"),
    "vertex_zero.obj": (OBJ + "f 0 1 2\n", "face index"),
}


PLY = ("ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
       "property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n" +
       "".join("%g %g %g\n" % x for x in VERTICES) + "".join("3 %d %d %d\n" % f for f in FACES))
WHOLE["mesh.ply"] = PLY % 4
DAMAGED["many_faces.ply"] = (PLY % 400000000, "header")


class MeshFiles(CliTest):
    def setUp(self):
        super().setUp()
        support.require("importer_assimp" in support.plugins(), "the plugin assimp")

    def mesh(self, name, content):
        (self.folder / name).write_bytes(content if isinstance(content, bytes) else
                                         content.encode())
        self.scene({"msim": 1, "objects": [{"type": "mesh", "file": name, "mass": 1, "k": 10}]})

    def test_whole_files(self):
        for name, content in WHOLE.items():
            with self.subTest(name):
                self.mesh(name, content)
                final = self.run_final("--integrator", "rk4", "--h", "1e-3", "--steps", "1")
                self.assertEqual(len(final["x"]), 4)

    def test_damaged_files(self):
        """One sentence that names the file."""
        for name, (content, word) in DAMAGED.items():
            with self.subTest(name):
                self.mesh(name, content)
                self.assert_refused(["run", "scene.json", "--integrator", "rk4", "--h", "1e-3",
                                     "--steps", "1"], name, word)


if __name__ == "__main__":
    support.main()
