"""Many sims that are stepped together."""
import signal
import subprocess
import sys
import textwrap

import msim
import numpy as np
import pytest


def make_sims(count=11, **options):
    sims = []
    for i in range(count):
        scene = msim.Scene(gravity=(0, 0, -9.81))
        scene.add_cloth((4 + i % 5, 5), (0, 0, 1), (0, 1, 0), (1, 0, 0), mass=0.2, k=50 + i,
                        pinned="first_corners")
        sims.append(msim.Sim(scene, integrator=("velocity-verlet", "implicit-euler")[i % 2],
                             h=1e-3, threads=1, **options))
    return sims


@pytest.mark.parametrize("threads", [0, 1, 2, 5])
def test_bits_are_those_of_single_steps(threads):
    alone, together = make_sims(), make_sims()
    for sim in alone:
        sim.step(9)
    msim.step_many(together, 4, threads=threads)
    msim.step_many(iter(together), 5, threads=threads)
    msim.step_many([], 5)
    for a, b in zip(alone, together):
        assert a.nsteps == b.nsteps == 9
        assert np.array_equal(a.x, b.x) and np.array_equal(a.v, b.v)


def test_an_error_names_the_sim():
    sims = make_sims()
    sims[5] = make_sims(newton_max_iterations=1, newton_rtol=1e-14)[5]
    with pytest.raises(msim.NotConvergedError, match=r"^sims\[5\]: "):
        msim.step_many(sims, 1)
    assert [sim.nsteps for sim in sims] == [1] * 5 + [0] + [1] * 5


def test_refusals():
    sims = make_sims(3)
    for bad, words in [(sims + sims[1:2], "one is there twice"), (sims + ["sim"], r"sims\[3\] must"),
                       ([None], r"sims\[0\] must be an msim.Sim; found NoneType")]:
        with pytest.raises(msim.ArgumentError, match=words):
            msim.step_many(bad)
    with pytest.raises(msim.ArgumentError, match="n must be"):
        msim.step_many(sims, -1)
    with pytest.raises(msim.ArgumentError, match="threads must be"):
        msim.step_many(sims, threads=257)
    assert [sim.nsteps for sim in sims] == [0, 0, 0]


def test_stop_and_force_functions():
    sims = make_sims(3)
    sims[1].stop()
    with pytest.raises(msim.StoppedError, match=r"^sims\[1\]: "):
        msim.step_many(sims, 10**6)
    assert len({sim.nsteps for sim in sims}) == 1
    scenes = [msim.Scene() for _ in range(3)]
    for scene in scenes:
        scene.add_particles([(0, 0, 0)], mass=1)
        scene.set_force(lambda t, particles, x, v: 1 / 0 if t > 0.05 else np.ones_like(x))
    sims = [msim.Sim(scene, integrator="rk4", h=0.01) for scene in scenes]
    msim.step_many(sims, 3, threads=2)
    assert sims[0].v[0, 0] == pytest.approx(0.03, rel=1e-12)
    with pytest.raises(ZeroDivisionError):
        msim.step_many(sims, 100, threads=2)


def test_ctrl_c_ends_the_steps_of_all():
    program = textwrap.dedent("""
        import msim
        from test_step_many import make_sims
        sims = make_sims()
        try:
            print("begin", flush=True)
            msim.step_many(sims, 10**9)
        except KeyboardInterrupt:
            print(len({sim.nsteps for sim in sims}), flush=True)
        """)
    child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True,
                             cwd=__file__.rsplit("/", 1)[0])
    assert child.stdout.readline() == "begin\n"
    child.send_signal(signal.SIGINT)
    out, _ = child.communicate(timeout=60)
    assert out == "1\n"
