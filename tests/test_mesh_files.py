"""Mesh files that are whole, damaged or truncated: what the plugin `assimp` makes of them."""
import base64
import json
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

# Vertices of no face, of those that follow OBJ
UNUSED = {
    "one.obj": (OBJ + "v 5 5 5\n", 1),
    "at_the_start.OBJ": ("v 5 5 5\nv 6 6 6\nv 5 5 5\n" + OBJ.replace("f", "#") +
                         "f -4 -2 -3\nf 4/1 5/2/3 7//4\n  f\t5 6 \\\n 7\nf 4 7 6\n", 3),
    "mark.obj": ("\ufeffv 5 5 5\n" + OBJ.replace("f", "#") + "f -4 -2 -3\nf -4 -3 -1\n"
                 "f -3 -2 -1\nf -4 -1 -2\n", 1),
    "faces_first.obj": (OBJ[OBJ.index("f"):] + OBJ[:OBJ.index("f")] + "v 0 0 9", 1),
    "equal.obj": (OBJ + "v 0 0 0\nv 0 0 0\nf 5 3 2\n", 1),
    "line.obj": (OBJ + "v 5 5 5\nv 6 6 6\nv 7 7 7\nl 5 6\nl 1 2\np 3\n", 3),
    "mac.obj": ((OBJ + "v 5 5 5\n").replace("\n", "\r"), 1),
    "normals.obj": (OBJ + "vt 0 0\nvn 0 0 1\nv\t3 4 5\n# v 1 2 3\nvp 1 2 3\n", 1),
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




def ply(faces=tuple(FACES), nvertices=4, nfaces=4):
    return ("ply\nformat ascii 1.0\ncomment x y z\nelement vertex %d\nproperty float x\n"
            "property float y\nproperty float z\nelement face %d\n"
            "property list uchar int vertex_indices\nend_header\n" % (nvertices, nfaces) +
            "".join("%g %g %g\n" % x for x in VERTICES) +
            "".join("%d %s\n" % (len(f), " ".join(map(str, f))) for f in faces))


def binary_ply(order, faces=tuple(FACES), length="B"):
    header = ("ply\nformat binary_%s_endian 1.0\nelement vertex 4\nproperty float32 x\n"
              "property float32 y\nproperty float32 z\nelement face 4\n"
              "property list %s int32 vertex_index\nend_header\n")
    head = header % ("little" if order == "<" else "big", {"B": "uint8", "i": "int"}[length])
    return (head.encode() + b"".join(struct.pack(order + "3f", *x) for x in VERTICES) +
            b"".join(struct.pack(order + length, len(f)) + struct.pack(order + f"{len(f)}i", *f)
                     for f in faces))


WHOLE.update({
    "mesh.ply": ply(),
    "mesh_without_line_end.ply": ply()[:-1],
    "carriage_returns.ply": ply().replace("\n", "\r\n"),
    "blank_line.ply": ply().replace("end_header\n", "end_header\n\n"),
    "edges.ply": (ply() + "0 1\n").replace("end_header", "element edge 1\nproperty int vertex1\n"
                                           "property int vertex2\nend_header"),
    "little.ply": binary_ply("<"),
    "big.ply": binary_ply(">"),
    "long_lists.ply": binary_ply(">", length="i"),
    "name_of_words.stl": text_stl().replace("solid a", "solid of vertex facet\tx"),
})

DAMAGED.update({
    "many_faces.ply": (ply(nfaces=400000000), "ends before face 4, and its header states 400000000"),
    "no_last_face.ply": (ply(FACES[:3]), "ends before face 3, and its header states 4"),
    "no_last_corner.ply": (ply()[:-2], "ends before face 3"),
    "no_last_corners.ply": (ply(FACES[:3]) + "3", "ends before face 3"),
    "vertex_missing.ply": (ply(nvertices=5), "vertex 4"),
    "vertex_more.ply": (ply(nvertices=3), "face 0"),
    "face_more.ply": (ply(nfaces=3), "more than its header states"),
    "one_coordinate_less.ply": (ply().replace("1 0 0\n", "1 0\n", 1), "vertex 1"),
    "one_coordinate_more.ply": (ply().replace("1 0 0\n", "1 0 0 7\n", 1), "vertex 1"),
    "word.ply": (ply().replace("1 0 0\n", "1 x 0\n", 1), "vertex 1"),
    "corner.ply": (ply((*FACES[:3], (0, 1, 4))), "face 3"),
    "corner_2_32.ply": (ply((*FACES[:3], (0, 1, 1 << 32))), "face 3"),
    "corner_of_parts.ply": (ply((*FACES[:3], (0, 1, 2.5))), "face 3"),
    "strips.ply": (ply(((0, 1, 2, 3),), nfaces=1).replace("element face", "element tristrips"),
                   "strips"),
    "no_such_type.ply": (ply().replace("float y", "quad y"), "header"),
    "lengths_of_floats.ply": (ply().replace("list uchar", "list float"), "header"),
    "no_end_header.ply": (ply().replace("end_header\n", ""), "header"),
    "within_face.ply": (binary_ply("<")[:-1], "ends before face 3"),
    "within_big_face.ply": (binary_ply(">")[:-13], "ends before face 3"),
    "goes_on.ply": (binary_ply("<") + b"\1", "more than its header states"),
    "big_corner.ply": (binary_ply(">", (*FACES[:3], (0, 1, -1))), "face 3"),
    "long_list.ply": (binary_ply("<", length="i")[:-16] + struct.pack("<4i", 2000000000, 0, 1, 2),
                      "ends before face 3"),
    "vertex_before.stl": (text_stl().replace("facet", "vertex 5 5 5\nfacet", 1),
                          "vertex outside of facets"),
    "vertex_behind.stl": (text_stl()[:-11] + "vertex 5 5 5\nendsolid\n", "facet 4"),
    "four_vertices.stl": (text_stl().replace(" endloop", "vertex 5 5 5\n endloop", 1), "facet 1"),
    "short_vertex.stl": (text_stl().replace("vertex 1 0 0", "vertex 1 0", 1), "facet 1"),
    "no_endfacet.stl": (text_stl().replace("endfacet\n", "", 1), "facet 1"),
})


def gltf(faces, count):
    """Indices of two bytes, of which the file states count."""
    data = (b"".join(struct.pack("<3f", *x) for x in VERTICES) +
            b"".join(struct.pack("<3H", *f) for f in faces))
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"uri": uri, "byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": len(data) - 48}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": count, "type": "SCALAR"}]})


# Capitals, and byte order marks: libassimp alone refuses or misreads these.
MARK = b"\xef\xbb\xbf"
WHOLE.update({
    "capitals.stl": text_stl().upper(),
    "some_capitals.stl": text_stl().replace("facet", "Facet").replace("vertex", "Vertex"),
    "behind_a_line.stl": "\n " + text_stl(),
    "mark.stl": MARK + text_stl().encode(),
    "mark.obj": MARK + OBJ.encode(),
    "mark.OBJ": MARK + OBJ.encode(),
    "mark.ply": MARK + ply().encode(),
})
DAMAGED.update({
    "truncated_capitals.stl": (text_stl()[:-11].upper(), "truncated"),
    "truncated_mark.stl": (MARK + text_stl()[:-11].encode(), "truncated"),
    "truncated_mark.ply": (MARK + ply()[:-2].encode(), "ends before face 3"),
    "mark_alone.obj": (MARK, "empty"),
    "mark_alone.stl": (MARK, "libassimp"),
    "no_such_vertex_behind_mark.obj": (MARK + (OBJ + "f 1 2 9\n").encode(), "out of range"),
})
WHOLE["mesh.gltf"] = gltf(FACES, 12)
DAMAGED["no_such_vertex.gltf"] = (gltf([*FACES, (0, 1, 4)], 15), "out-of-range")
DAMAGED["one_index_less.gltf"] = (gltf(FACES, 11), "TRIANGLES")


class MeshFiles(CliTest):
    def setUp(self):
        super().setUp()
        support.require("importer_assimp" in support.plugins(), "the plugin assimp")

    def mesh(self, name, content):
        (self.folder / name).write_bytes(content if isinstance(content, bytes) else
                                         content.encode())
        self.scene({"msim": 1, "objects": [{"type": "mesh", "file": name, "mass": 1, "k": 10}]})

    def test_planes_constrain(self):
        """A mesh lets planes constrain, unless the file says otherwise."""
        self.write("mesh.obj", OBJ)
        for keys in ({}, {"planes_constrain": True}, {"planes_constrain": False}):
            with self.subTest(keys):
                self.scene({"msim": 1, "planes": [{"normal": [0, 0, 1], "offset": -1}], **keys,
                            "objects": [{"type": "mesh", "file": "mesh.obj", "mass": 1, "k": 10}]})
                out = self.good("explain", "scene.json", "--integrator", "implicit-euler",
                                "--h", "0.01", "--steps", "1")
                self.assertEqual("the matrix holds particles" in out,
                                 keys.get("planes_constrain", True))

    def test_whole_files(self):
        for name, content in WHOLE.items():
            with self.subTest(name):
                self.mesh(name, content)
                final = self.run_final("--integrator", "rk4", "--h", "1e-3", "--steps", "1")
                self.assertEqual({tuple(round(c, 3) for c in x) for x in final["x"]}, set(VERTICES))

    def test_unused_vertices(self):
        """Those of no face are counted, also where libassimp does not return them."""
        for name, (content, count) in UNUSED.items():
            with self.subTest(name):
                self.mesh(name, content)
                status, _, err = self.cli("run", "scene.json", "--integrator", "rk4", "--h", "1e-3",
                                          "--steps", "1", "--final", "final.json", "--force")
                self.assertEqual(status, 0, err)
                self.assertEqual(len(self.final("final.json")["x"]), 4)
                word = "vertex" if count == 1 else "vertices"
                self.assertIn(f"{count} {word} of no face left out", err)

    def test_damaged_files(self):
        """One sentence that names the file."""
        for name, (content, word) in DAMAGED.items():
            with self.subTest(name):
                self.mesh(name, content)
                self.assert_refused(["run", "scene.json", "--integrator", "rk4", "--h", "1e-3",
                                     "--steps", "1"], name, word)


if __name__ == "__main__":
    support.main()
