"""Threads and signals: the GIL, sims in use, stop(), Ctrl-C."""
import signal
import subprocess
import sys
import textwrap
import threading
import time

import msim
import numpy as np
import pytest


@pytest.fixture
def big():
    """Steps take about a millisecond each."""
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_cloth((100, 100), (0, 0, 1), (0, 1, 0), (1, 0, 0), mass=1, k=100,
                    pinned="first_corners")
    return msim.Sim(scene, integrator="velocity-verlet", h=1e-5, threads=1)


def in_background(target):
    """Run it in a thread; returns the thread and what it raised, or []."""
    raised = []

    def work():
        try:
            target()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    return thread, raised


def until(condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


def is_busy(sim):
    try:
        sim.t
    except msim.BusyError:
        return True
    return False


@pytest.mark.parametrize("use", [
    lambda s: s.x, lambda s: s.t, lambda s: s.step(), lambda s: s.run(), lambda s: s.energy,
    lambda s: s.stats, lambda s: s.plan, lambda s: s.set_state(t=0), lambda s: s.set_springs(k=1),
    lambda s: s.dumps(), lambda s: s.loads(b""), lambda s: s.explain(), lambda s: setattr(s, "h", 1),
    lambda s: s.recorder("never.csv"), lambda s: s.force(), lambda s: s.matrix()])
def test_a_sim_in_use_refuses_other_threads(big, use):
    thread, raised = in_background(lambda: big.step(10**9))
    until(lambda: is_busy(big))  # and the GIL is free
    try:
        with pytest.raises(msim.BusyError, match="another thread"):
            use(big)
    finally:
        big.stop()
        thread.join()
    assert isinstance(raised[0], msim.StoppedError)
    big.step()


def test_views_can_be_read_meanwhile(big):
    x = big.x
    thread, _ = in_background(lambda: big.step(10**9))
    until(lambda: is_busy(big))
    assert np.isfinite(x).all()
    big.stop()
    thread.join()


def test_an_observed_sim_refuses_other_threads(big):
    seen = []

    def observer(sim):
        thread, raised = in_background(lambda: sim.t)
        thread.join()
        seen.extend(raised)
        return True

    big.run(every=1, observer=observer)
    assert isinstance(seen[0], msim.BusyError)


def test_distinct_sims_run_in_distinct_threads(cloth):
    sims = [msim.Sim(cloth, integrator="velocity-verlet", h=1e-3) for _ in range(4)]
    threads = [in_background(lambda sim=sim: sim.step(2000)) for sim in sims]
    for thread, raised in threads:
        thread.join()
        assert raised == []
    alone = msim.Sim(cloth, integrator="velocity-verlet", h=1e-3)
    alone.step(2000)
    for sim in sims:
        np.testing.assert_array_equal(sim.x, alone.x)


def test_stop_ends_runs(big):
    thread, raised = in_background(lambda: big.run(every=10**8))
    until(lambda: is_busy(big))
    big.stop()
    thread.join()
    assert isinstance(raised[0], msim.StoppedError) and big.nsteps > 0


def test_stop_ends_frames_of_options(pair):
    sim = msim.Sim(pair, integrator="velocity-verlet", h=1e-6, t_end=1e3)
    results = []
    thread, raised = in_background(lambda: results.append(sim.run()))
    until(lambda: is_busy(sim))
    sim.stop()
    thread.join()
    assert raised == [] and results[0].status == msim.Status.STOPPED


def test_stop_before_a_step_takes_effect_after_one(pair):
    sim = msim.Sim(pair, integrator="velocity-verlet", h=1e-3)
    sim.stop()
    with pytest.raises(msim.StoppedError):
        sim.step(10)
    assert sim.nsteps == 1
    sim.step(10)
    assert sim.nsteps == 11


def test_a_request_to_stop_that_was_served_is_forgotten(pair):
    sim = msim.Sim(pair, integrator="velocity-verlet", h=1e-3, steps=100)
    sim.stop()
    assert list(sim.frames()) == []
    sim.step(10)
    assert sim.nsteps == 10


def test_long_runs_have_the_bits_of_short_ones(big):
    """The requests to stop that let signals in change nothing."""
    scene_steps = 300
    other = msim.Sim(big_scene(), integrator="velocity-verlet", h=1e-5, threads=1,
                     steps=scene_steps, every=scene_steps)
    other.run()
    for _ in range(scene_steps):
        big.step()
    np.testing.assert_array_equal(other.x, big.x)


def big_scene():
    scene = msim.Scene(gravity=(0, 0, -9.81))
    scene.add_cloth((100, 100), (0, 0, 1), (0, 1, 0), (1, 0, 0), mass=1, k=100,
                    pinned="first_corners")
    return scene


INTERRUPTED = """
import sys, time, msim
scene = msim.Scene()
scene.add_particles([[0, 0, 0], [1.1, 0, 0]], mass=1)
scene.add_springs([[0, 1]], k=10, rest=1)
sim = msim.Sim(scene, integrator="velocity-verlet", h=1e-6, t_end=1e4, every=10**9)
print("ready", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print("interrupted", flush=True)
before = sim.nsteps
sim.step(5)
assert before > 0 and sim.nsteps == before + 5, (before, sim.nsteps)
print("went on", flush=True)
"""


@pytest.mark.parametrize("call", ["sim.step(10**10)", "sim.run()", "list(sim.frames())"])
def test_ctrl_c(call):
    """The answer must come within 2 s, though the run would take hours; the sim stays usable."""
    with subprocess.Popen([sys.executable, "-c", textwrap.dedent(INTERRUPTED).format(call=call)],
                          stdout=subprocess.PIPE, text=True) as process:
        watchdog = threading.Timer(30, process.kill)
        watchdog.start()
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "interrupted\n"
        assert time.monotonic() - sent < 2
        assert process.stdout.readline() == "went on\n"
    watchdog.cancel()
    assert process.returncode == 0
