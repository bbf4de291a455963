"""Refusals: the type, the status, and that the sentence names what is wrong and what is right."""
import msim
import numpy as np
import pytest

NAN = float("nan")
ORIGIN, ALONG_X, ALONG_Y = (0, 0, 0), (1, 0, 0), (0, 1, 0)
LINE = {"start": ORIGIN, "end": ALONG_X, "mass": 1, "k": 1}
SHEET = {"origin": ORIGIN, "row": ALONG_X, "column": ALONG_Y, "mass": 1, "k": 1}
BOX = {"origin": ORIGIN, "size": (1, 1, 1), "mass": 1, "k": 1}


def scene_of_two():
    scene = msim.Scene()
    scene.add_particles([[0, 0, 0], [1.1, 0, 0]], mass=1)
    scene.add_springs([[0, 1]], k=10, rest=1)
    return scene


def sim(**options):
    return msim.Sim(scene_of_two(), **{"integrator": "rk4", "h": 0.01, **options})


SCENES = [
    (lambda s: msim.Scene(gravity=-9.81), "gravity must be three numbers; found -9.81"),
    (lambda s: msim.Scene(gravity=(0, -9.81)), "gravity must be three numbers; found .* (2,)"),
    (lambda s: msim.Scene(gravity="down"), "gravity must hold real numbers; found 'down'"),
    (lambda s: msim.Scene(gravity=None), "gravity must hold real numbers; found None"),
    (lambda s: msim.Scene(gravity=(0, 0, NAN)), "gravity[2] is nan; it must be finite"),
    (lambda s: msim.Scene(drag=-1), "drag is -1; it must be a finite number >= 0"),
    (lambda s: msim.Scene(drag="0,1"), "drag must be a number; found '0,1'"),
    (lambda s: msim.Scene(drag=np.zeros((2, 2))),
     "drag must be a number; found array([[0., 0.], [0., 0.]])"),
    (lambda s: s.add_sphere(ORIGIN, 1, inside="no"), "inside must be True or False; found 'no'"),
    (lambda s: s.set_force(lambda t, p, x, v: 0 * x, time="t"),
     "time must be True or False; found 't'"),
    (lambda s: sim().set_pinned(0, "no"), "pinned must be True or False; found 'no'"),
    (lambda s: msim.Scene(name=5), "name must be a text; found 5"),
    (lambda s: setattr(s, "name", None), "name must be a text; found None"),
    (lambda s: setattr(s, "gravity", 1), "gravity must be three numbers; found 1"),
    (lambda s: s.add_particles([0, 0, 0], 1), "x must have the shape (n, 3); found .* (3,)"),
    (lambda s: s.add_particles([[0, 0, 0], [1, 1]], 1), "x must be rows of equal length"),
    (lambda s: s.add_particles(None, 1), "x must hold real numbers; found None"),
    (lambda s: s.add_particles([[0, 0, 1j]], 1), "x must hold real numbers; found .* complex128"),
    (lambda s: s.add_particles([ORIGIN], "1 kg"), "mass must hold real numbers; found '1 kg'"),
    (lambda s: s.add_particles([ORIGIN], [1, 2]), "mass must be one number, or one for each of 1"),
    (lambda s: s.add_particles([ORIGIN], 0), "mass[0] is 0; it must be a finite number > 0"),
    (lambda s: s.add_particles([ORIGIN], 1, v=ALONG_X), "v must have the shape (1, 3)"),
    (lambda s: s.add_springs([0, 1], 1), "ij must have the shape (n, 2); found .* (2,)"),
    (lambda s: s.add_springs([[0, 2]], 1), "ij[0] refers to particle 2; there are 2 particles"),
    (lambda s: s.add_springs([[0.0, 1.0]], 1), "ij must hold integers (indices"),
    (lambda s: s.add_springs([["0", "1"]], 1), "ij must hold integers (indices"),
    (lambda s: s.add_springs([[0, -1]], 1), "ij must hold indices from 0 to 2147483647; found -1"),
    (lambda s: s.add_springs([[0, 2**40]], 1), "ij must hold indices from 0 .* found 1099511627776"),
    (lambda s: s.add_springs([[1, 1]], 1), "connects particle 1 to itself; remove this spring"),
    (lambda s: s.add_springs([[0, 1]], [1, 2]), "k must be one number, or one for each of 1 springs"),
    (lambda s: s.add_springs([[0, 1]], 1, rest="auto"), "rest must hold real numbers; found 'auto'"),
    (lambda s: s.add_springs([[0, 1]], 1, damping=-1), "damping[0] is -1; it must be a finite"),
    (lambda s: s.add_faces([[0, 1, 1]]), "faces[0] has particle 1 twice"),
    (lambda s: s.add_plane(1), "normal must be three numbers; found 1"),
    (lambda s: s.add_plane(ORIGIN), "normal is 0; it must be a nonzero vector"),
    (lambda s: s.add_plane(ALONG_X, restitution=2), "restitution is 2; it must lie in [0, 1]"),
    (lambda s: s.add_plane(ALONG_X, "0"), "offset must be a number; found '0'"),
    (lambda s: s.pin([True, False]), "particles must hold integers .* not a flag for each"),
    (lambda s: s.pin("all"), "particles must hold integers (indices of particles); found ['all']"),
    (lambda s: s.pin(5), "pinned[0] is 5; there are 2 particles, counted from 0"),
    (lambda s: s.add_rope(2.5, **LINE), "n must be a whole number from 0 to 2147483647; found 2.5"),
    (lambda s: s.add_rope(True, **LINE), "n must be a whole number .* found True"),
    (lambda s: s.add_rope(10**12, **LINE), "n must be a whole number from 0 to 2147483647"),
    (lambda s: s.add_rope(3, **{**LINE, "end": 1}), "end must be three numbers; found 1"),
    (lambda s: s.add_rope(3, **{**LINE, "k": [1, 2]}), "k must be a number; found [1, 2]"),
    (lambda s: s.add_rope(3, pinned="corners", **LINE), "pinned must be indices; 'corners' is a name"),
    (lambda s: s.add_cloth(5, **SHEET), "n must be 2 whole numbers; found 5"),
    (lambda s: s.add_cloth((5, 5), **{**SHEET, "k": {"struct": 1}}), "k has no key 'struct'"),
    (lambda s: s.add_cloth((5, 5), pinned="top", **SHEET), "pinned is 'top'; it must be indices or"),
    (lambda s: s.add_cloth((5, 5), pinned=["top"], **SHEET), "pinned must hold integers .* 'top'"),
    (lambda s: s.add_lattice((2, 2), **BOX), "n must be 3 whole numbers; found (2, 2)"),
    (lambda s: msim.Scene.load(5), "path must be a text or a path; found 5"),
    (lambda s: s.save(None), "path must be a text or a path; found None"),
    (lambda s: msim.Scene.loads(5), "text must be a text or bytes; found 5"),
    (lambda s: msim.Scene.from_dict([]), "tree must be a mapping, as .* found []"),
    (lambda s: msim.Scene.from_dict({"masses": 1}), "masses is an unknown key"),
    (lambda s: msim.Scene.from_dict({"particles": {"x": {1}}}), "a scene cannot hold a set; use"),
    (lambda s: msim.Scene.from_dict({"h": 1}), "h is an unknown key here; it belongs into 'run'"),
]

SIMS = [
    (lambda: msim.Sim("scene.json"), "scene must be an msim.Scene; found str"),
    (lambda: msim.Sim(msim.Scene(), integrator="rk4"), "the scene has no particles"),
    (lambda: msim.Sim(scene_of_two()), "no integrator is given; set the option integrator"),
    (lambda: sim(h="0,01"), "h is '0,01'; it must be a number > 0 or auto, with a decimal point"),
    (lambda: sim(h=True), "h must be number > 0 | auto; found True"),
    (lambda: sim(h=[0.1]), "h must be a number or a text; found [0.1]"),
    (lambda: sim(tol=1e-3, steps=4), "tol and steps exclude each other"),
    (lambda: sim(steps=1.5), "steps is '1.5'; it must be a whole number >= 0"),
    (lambda: sim(integrator="verlet", tol=1e-3), "integrator 'verlet' has no error control"),
    (lambda: sim().step(1.5), "n must be a whole number from 0 to 9223372036854775807; found 1.5"),
    (lambda: sim().step(-1), "n must be a whole number from 0 .* found -1"),
    (lambda: sim().run(), "the run has no end: give Sim the option t_end or steps"),
    (lambda: sim(t_end=1).run(every=1.5), "every must be a whole number from 1 .* found 1.5"),
    (lambda: sim(t_end=1).run(every="a"), "every must be a whole number from 1 .* found 'a'"),
    (lambda: sim(t_end=1).run(fps="a"), "fps must be a number; found 'a'"),
    (lambda: sim(t_end=1).run(fps=-1), "fps must be > 0; found -1"),
    (lambda: sim().run(t_end="a"), "t_end must be a number; found 'a'"),
    (lambda: sim().run(t_end=-1), "t_end = -1 s lies before the present time 0 s"),
    (lambda: sim().run(t_end=NAN), "t_end must be finite; found nan"),
    (lambda: sim(t_end=1).run(every=1, fps=2), "give every or fps, not both"),
    (lambda: sim(t_end=1).run(observer=5), "observer must be a function of the sim; found 5"),
    (lambda: sim(t_end=1).run(out=5), "path must be a text or a path; found 5"),
    (lambda: sim().set_state(x=[ORIGIN]), "x must have the shape (2, 3); found .* (1, 3)"),
    (lambda: sim().set_state(step=1.5), "step must be a whole number from 0 .* found 1.5"),
    (lambda: sim().set_state(t="a"), "t must be a number; found 'a'"),
    (lambda: sim().set_springs(k=[1, 2]), "k must be one number, or one for each of 1 springs"),
    (lambda: setattr(sim(), "h", 0), "h must be a finite number > 0 or 'auto'; found 0"),
    (lambda: setattr(sim(), "h", "slow"), "h must be a finite number > 0 or 'auto'; found 'slow'"),
    (lambda: sim().matrix(), "integrator 'rk4' needs no matrix"),
    (lambda: sim().loads("x"), "data must be bytes, as dumps() returns; found 'x'"),
    (lambda: sim().loads(b"hello"), "the 5 bytes are not a checkpoint of msim"),
    (lambda: sim().loads(sim(h=0.02).dumps()), "h is 0.01 here and 0.02 in the checkpoint"),
]


def assert_names(text, words):
    """The words of a sentence stand in it, in their order; .* stands for any others."""
    at = 0
    for part in words.split(" .* "):
        assert part in text[at:], text
        at += text[at:].index(part) + len(part)
    assert "\n" not in text


@pytest.mark.parametrize("call, words", SCENES, ids=[words for _, words in SCENES])
def test_scenes(call, words):
    scene = scene_of_two()
    before = scene.dumps()
    with pytest.raises(msim.ArgumentError) as error:
        call(scene)
    assert error.value.status == msim.Status.ERR_ARG
    assert_names(str(error.value), words)
    assert scene.dumps() == before


@pytest.mark.parametrize("call, words", SIMS, ids=[words for _, words in SIMS])
def test_sims(call, words):
    with pytest.raises(msim.ArgumentError) as error:
        call()
    assert error.value.status == msim.Status.ERR_ARG
    assert_names(str(error.value), words)


@pytest.mark.parametrize("call, status, words", [
    (lambda: msim.Scene.load("none.json"), "ERR_IO", "none.json: cannot be read: No such file"),
    (lambda: sim().load("none.ckpt"), "ERR_IO", "none.ckpt: No such file or directory"),
    (lambda: sim().save("none/run.ckpt"), "ERR_IO", "none/run.ckpt: No such file or directory"),
    (lambda: msim.Trajectory("none.csv"), "ERR_IO", "none.csv: No such file or directory"),
    (lambda: sim(t_end=1).run(out="none/run.csv"), "ERR_IO", "none/run.csv could not be opened"),
    (lambda: sim(t_end=1).run(out="run.mp4"), "ERR_NAME", "must end in .html, .vtkhdf, .pvd, .csv"),
    (lambda: sim(integrator="RK4"), "ERR_NAME", "'RK4' (did you mean 'rk4'?)"),
    (lambda: sim(integrator="implicit-euler", solver="lu"), "ERR_NAME", "'lu' (did you mean 'klu'?)"),
    (lambda: msim.Trajectory("run.txt"), "ERR_UNSUPPORTED", "ends in .csv or .vtkhdf")])
def test_files_and_names(tmp_path, monkeypatch, call, status, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(msim.Error) as error:
        call()
    assert error.value.status == msim.Status[status] and words in str(error.value)


def test_damaged_trajectories(tmp_path):
    path = tmp_path / "run.csv"
    sim(t_end=0.1).run(out=path)
    path.write_text(path.read_text().replace("\n0,0,", "\n0,zero,", 1))
    with pytest.raises(msim.ArgumentError, match=r"run.csv: .*'zero'"):
        msim.Trajectory(path)


@pytest.mark.parametrize("index", ["a", slice(0, 2), 1.5, None])
def test_frames_that_are_no_numbers(tmp_path, index):
    sim(t_end=0.1).run(out=tmp_path / "run.csv")
    with pytest.raises(TypeError, match="a frame must be a whole number"):
        msim.Trajectory(tmp_path / "run.csv")[index]


def test_what_is_accepted():
    """The refusals above leave all forms of the same numbers."""
    scene = scene_of_two()
    scene.add_cloth(np.array([2, 2]), **SHEET)
    scene.add_cloth([np.int64(2), 2], **SHEET)
    run = msim.Sim(scene, integrator="rk4", h=np.float32(0.01), watch=np.bool_(True))
    run.step(np.int32(2))
    run.set_state(t=0, step=np.int64(0))
    run.h = "auto"
    assert len(run.run(every=np.int64(2), t_end=np.float64(0.1))) > 1
