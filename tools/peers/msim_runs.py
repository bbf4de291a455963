"""Runs of msim as a user of its Python package makes them."""
import time

import msim


class Peer:
    """precision: "double" or "single"; of integrator `auto`, "auto"."""

    def __init__(self, scene, precision):
        self.scene, self.precision = scene, precision

    def longest_step(self, method):
        return msim.Sim(self.scene, integrator=method, h="auto", steps=1).plan.h / 0.9

    def run(self, method, h, steps):
        sim = msim.Sim(self.scene, integrator=method, h=h, steps=steps, threads=1,
                       precision=self.precision)
        start = time.process_time()
        sim.step(steps)
        return sim.x.copy(), time.process_time() - start

    def run_auto(self, _, tol, t_end):
        """With its choice of a method, which the creation of the sim includes."""
        start = time.process_time()
        sim = msim.Sim(self.scene, integrator="auto", tol=tol, t_end=t_end, every=10**9, threads=1,
                       precision=self.precision)
        sim.run()
        return sim.x.copy(), time.process_time() - start
