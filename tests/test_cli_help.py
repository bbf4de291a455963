"""Tests of what msim_cli says about itself: help on topics, the format of scene files as text and
as a JSON schema, the manual page and the completion of shells, made from the loader's tables."""

import json
import re
import shutil
import subprocess
import unittest
from pathlib import Path

import support
from cli_support import CliTest, OPTIONS, SCENES
from json_schema import is_valid

BAD_SCENES = Path(__file__).parent / "bad_scenes"
# Refused by the loader for relations between values, for sizes, or for what JSON schemas do not
# distinguish: 1 and 1.0, the order of indices, a length that must be that of another array.
NOT_STRUCTURAL = set("""
    cloth_n_absurd collider_heights_row collider_heights_short collider_heights_too_far
    collider_motion_order collider_motion_short collider_motion_too_far collider_no_axis
    collider_sdf_open collider_too_large collider_turns_too_fast faces_twice ij_huge ij_itself
    ij_out_of_range ij_real k_long lattice_mass_vanishes lattice_n_absurd law_too_steep
    mass_short motion_too_far motion_too_fast no_particles_in_x pinned_moving
    pinned_out_of_range plane_offset_overflow plane_zero_normal rope_n_absurd rope_n_point
    rope_pinned_out_of_range rope_too_far run_threads_huge spring_too_long v_one_row v_short
    version_real""".split())


def keys(schema, path=""):
    """(path, schema, required) of each key in a schema, in order."""
    for name, member in schema.get("properties", {}).items():
        if "const" in member and "description" not in member:
            continue  # the type of an object
        yield path + name, member, name in schema.get("required", ())
        yield from keys(member, f"{path}{name}.")
        items = member.get("items", {})
        yield from keys(items, f"{path}{name}[].")
        for each in items.get("oneOf", ()):
            yield from keys(each, f"{path}{name}[{each['title']}].")


class Schema(CliTest):
    def setUp(self):
        super().setUp()
        self.schema = json.loads(self.good("help", "scene", "--json"))

    def test_every_key_is_described(self):
        found = list(keys(self.schema))
        self.assertGreater(len(found), 60)
        for path, key, required in found:
            with self.subTest(path):
                self.assertGreater(len(key["description"]), 4)
                self.assertTrue(key["values"])
                self.assertEqual(len(key["examples"]), 1)
                self.assertTrue(is_valid(key, key["examples"][0]), key["examples"])
                self.assertFalse(required and "default" in key)
                if "default" in key:
                    self.assertTrue(is_valid(key, key["default"]), key["default"])

    def known_keys(self, scene, part):
        """The loader lists the keys that it knows when it finds another one."""
        part["qqqqq"] = 1
        self.write("scene.json", scene)
        status, _, err = self.cli("explain", "scene.json")
        self.assertEqual(status, 1)
        return set(re.search(r"qqqqq is an unknown key; the keys are (.*)", err)[1].split(", "))

    def test_keys_are_those_of_the_loader(self):
        properties = self.schema["properties"]
        scene = {"msim": 1}
        self.assertEqual(self.known_keys(scene, scene), set(properties))
        for name in ("particles", "springs"):
            scene = {"msim": 1, "particles": {"x": [], "mass": 1}}
            part = scene.setdefault(name, {})
            self.assertEqual(self.known_keys(scene, part), set(properties[name]["properties"]))
        plane = {}
        self.assertEqual(self.known_keys({"msim": 1, "planes": [plane]}, plane),
                         set(properties["planes"]["items"]["properties"]))
        for name in ("objects", "colliders"):
            for kind in properties[name]["items"]["oneOf"]:
                part = {"type": kind["title"]}
                self.assertEqual(self.known_keys({"msim": 1, name: [part]}, part),
                                 set(kind["properties"]))

    def test_options_are_those_of_the_command_line(self):
        run = self.schema["properties"]["run"]["properties"]
        text = self.good("run", "--help")
        self.assertEqual([f"--{name}" for name in run] + ["--plugin_path"],
                         re.findall(r"(?m)^  (--[\w.]+) ?", text[text.index("\nOptions"):]))
        self.assertLessEqual(set(OPTIONS), set(run))

    def test_shipped_scenes_are_valid(self):
        scenes = sorted(SCENES.glob("*.json"))
        self.assertTrue(scenes)
        for path in scenes:
            with self.subTest(path.name):
                self.assertTrue(is_valid(self.schema, json.loads(path.read_text())))

    def test_bad_scenes_are_invalid(self):
        names = {path.stem for path in BAD_SCENES.glob("*.json")
                 if not path.stem.startswith("syntax_")} - {"empty", "blank"}
        self.assertGreater(len(names), 90)
        valid = {name for name in names if is_valid(self.schema, json.loads(
            (BAD_SCENES / f"{name}.json").read_text()))}
        self.assertEqual(valid, NOT_STRUCTURAL)


class Text(CliTest):
    def test_scene(self):
        text = self.good("help", "scene")
        self.assertLessEqual(max(map(len, text.splitlines())), 80)
        flat = " ".join(text.split())
        for path, key, required in keys(json.loads(self.good("help", "scene", "--json"))):
            head = re.sub(r"\\\[(\w+)\\\]", r"\[([^]]*\\b\1\\b[^]]*)?\]", re.escape(path))
            self.assertRegex(flat, f" {head} {re.escape(key['description'])} \\(")
        for once in (" objects[].damping ", " colliders[sphere, box].center ", " colliders[box].size "):
            self.assertEqual(flat.count(once), 1, once)
        self.assertNotIn("colliders[sphere].restitution", flat)
        self.assertIn("masses (kg; a finite number > 0 for all, or an array of one for each; "
                      'required) "mass": 0.5', flat)
        self.assertIn("particles.pinned", text)

    def test_topics(self):
        self.assertEqual(self.good("help"), self.good("--help"))
        for command in ("run", "explain", "list"):
            self.assertEqual(self.good("help", command), self.good(command, "--help"))
        out = self.good("help", "t_end")
        self.assertIn("--t_end ", out)
        self.assertIn("run.t_end ", out)
        self.assertEqual(self.good("help", "--t_end"), out)
        self.assertIn("--out FILE ", self.good("help", "out"))
        self.assertIn("completion SHELL ", self.good("help", "completion"))
        self.assertIn("Runge-Kutta with 12 stages", self.good("help", "dop853"))
        self.assertIn("objects[cloth].pinned", self.good("help", "pinned"))
        self.assertNotIn("objects", self.good("help", "particles.mass"))

    def test_refusals(self):
        for args, *words in ((["help", "masss"], "did you mean 'mass'?"),
                             (["help", "leapfrog"], "did you mean 'velocity-verlet'?"),
                             (["help", "zzzzzz"], "there is no topic 'zzzzzz'"),
                             (["help", "run", "scene"], "one topic"),
                             (["help", "man", "--json"], "after scene only"),
                             (["simulate"], "did you mean 'run'?"),
                             (["version"], "did you mean '--version'?"),
                             (["completion"], "bash or zsh"),
                             (["completion", "fish"], "bash or zsh")):
            with self.subTest(" ".join(args)):
                self.assert_refused(args, *words)


class Manual(CliTest):
    def test_names_everything(self):
        text = self.good("help", "man")
        for word in ("SYNOPSIS", "OPTIONS", "SCENE FILES", "EXIT STATUS", "solver.rtol",
                     "objects[rope].from"):
            self.assertIn(word, text)
        lines = [line for line in text.splitlines() if re.match(r"[.']", line)]
        for line in lines:
            self.assertRegex(line, r"^\.(TH|SH|TP|B|I|br|nf|fi)\b")

    def test_man_renders_it_without_warnings(self):
        if not shutil.which("man") or not shutil.which("groff"):
            self.skipTest("man is missing")
        self.write("msim_cli.1", self.good("help", "man"))
        done = subprocess.run(["man", "-l", "--warnings", "msim_cli.1"], cwd=self.folder, text=True,
                              capture_output=True, timeout=60,
                              env={"PATH": "/usr/bin:/bin", "LC_ALL": "C.UTF-8", "MANWIDTH": "80"})
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn("--integrator", done.stdout)


class Completion(CliTest):
    def complete(self, *words):
        """What bash offers for the last word."""
        script = self.good("completion", "bash") + (
            f'COMP_WORDS=({" ".join(map(repr, words))}); COMP_CWORD={len(words) - 1}\n'
            '_msim_cli_words; printf "%s\\n" "${COMPREPLY[@]}"\n')
        return support.run("bash", "-c", script).split()

    def test_bash(self):
        support.require(shutil.which("bash"), "bash")
        for words, offered in (
                (["msim_cli", "ex"], ["explain"]),
                (["msim_cli", "--v"], ["--version"]),
                (["msim_cli", "run", "a.json", "--integrator", "velo"], ["velocity-verlet"]),
                (["msim_cli", "run", "--jacobian", ""], ["exact", "clamp"]),
                (["msim_cli", "run", "--solver", "cho"], ["cholmod"]),
                (["msim_cli", "run", "--h", ""], ["auto"]),
                (["msim_cli", "run", "--qui"], ["--quiet"]),
                (["msim_cli", "explain", "--qui"], []),
                (["msim_cli", "list", "--"], ["--help", "--plugin_path"]),
                (["msim_cli", "help", "sc"], ["scene"]),
                (["msim_cli", "completion", ""], ["bash", "zsh"]),
                (["msim_cli", "run", "sce"], []),  # files, by complete -o default
                (["msim_cli", "run", "--out", ""], [])):
            with self.subTest(words):
                self.assertEqual(self.complete(*words), offered)

    def test_zsh(self):
        if not shutil.which("zsh"):
            self.skipTest("zsh is missing")
        self.write("_msim_cli", self.good("completion", "zsh"))
        support.run("zsh", "-n", self.folder / "_msim_cli")


if __name__ == "__main__":
    support.main()
