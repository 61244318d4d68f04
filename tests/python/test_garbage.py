"""What the garbage collector frees: simulations, models, frames and pools in cycles. The test is
run with MALLOC_PERTURB_, so that what is used after it was freed is wrong in every run."""
import gc
import itertools
import os
import unittest
from concurrent import futures

from support import SMALL, bst, main
from boresight._owned import Owned


class Node:
    """Part of a cycle."""


def fail(data, info):
    """A frame stage with a mistake."""
    raise ValueError("mine")


class Cycles(unittest.TestCase):
    def setUp(self):
        gc.collect()
        gc.disable()
        self.addCleanup(gc.enable)

    def test_simulations_whose_stage_raised(self):
        # exception, traceback and frames are a cycle with simulation and model in it
        def once(name):
            scenario = SMALL.with_plugin(frame_stage=bst.register(name, frame_stage=fail))
            try:
                with bst.Simulation(scenario) as sim:
                    sim.run_until(2)
            except ValueError as error:
                return str(error)
        for name in ("first", "second", "third"):
            self.assertEqual(once(name), "mine")
        self.assertGreater(gc.collect(), 0)

    def test_a_simulation_is_freed_before_its_model(self):
        # freed, modules of plug-ins look at the model's descriptors
        stage = bst.register("fine", frame_stage=lambda data, info: None)
        for lent in (False, True):
            model = bst.Model(SMALL.with_plugin(frame_stage=stage))
            sim = bst.Simulation(model)
            frame = sim.step("frame")
            node = Node()
            node.all = [node, model, sim, bst.Pool(1), frame if lent else None]
            del model, sim, frame, node
            self.assertGreater(gc.collect(), 0)

    def test_a_finaliser_of_the_cycle_gets_an_error(self):
        """It may come after that of the simulation, or before: then the simulation works."""
        seen = []

        class User:
            def __del__(self):
                for use in (lambda: self.sim.tick, lambda: bst.Simulation(self.sim.model).tick,
                            lambda: self.held.step("frame"), self.hold,
                            lambda: int(self.frame.data.sum())):
                    try:
                        seen.append(use())
                    except (bst.ClosedError, bst.BusyError):
                        seen.append(None)

            def hold(self):
                with bst.Pool(1).hold([self.sim]):
                    return 0
        for lent, late, held in itertools.product((False, True), repeat=3):
            with self.subTest(lent=lent, late=late, held=held):
                user = None if late else User()
                sim = bst.Simulation(SMALL)
                user, pool, frame = user or User(), bst.Pool(1), sim.step("frame").copy()
                total = int(frame.data.sum())
                user.frame = sim.view_frame() if lent else frame
                user.context = pool.hold([sim if held else None])
                user.held = user.context.__enter__()
                user.sim, user.pool, sim.user = sim, pool, user
                del sim, user, pool, frame
                gc.collect()
                # pixels stay valid for as long as the array is there
                self.assertEqual((len(seen), seen[-1]), (5, total))
                seen.clear()


class Called(Owned):
    """One whose finaliser the test calls."""

    def __del__(self):
        pass


class Order(unittest.TestCase):
    """Owned with a function of Python in place of the C library's."""

    def test_what_needs_another_goes_first(self):
        for order in itertools.permutations(range(4)):
            freed, chain = [], []
            for k in range(4):
                chain.append(Called(k, freed.append, *chain[-1:]))
            for k in order:  # as a cycle's finalisers come: in any order
                self.assertTrue(chain[k].live)
                Owned.__del__(chain[k])
                self.assertFalse(chain[k].live)
            self.assertEqual(freed, [3, 2, 1, 0])

    def test_one_that_several_need_goes_with_the_last(self):
        freed = []
        model = Owned(0, freed.append)
        sims = [Owned(k, freed.append, model) for k in (1, 2, 3)]
        del model
        for k, expected in ((1, [2]), (0, [2, 1]), (0, [2, 1, 3, 0])):
            del sims[k]
            self.assertEqual(freed, expected)

    def test_each_is_freed_once_in_threads(self):
        freed = []
        for _ in range(200):
            model = Owned(0, freed.append)
            sims = [Owned(k, freed.append, model) for k in range(1, 5)]
            del model
            with futures.ThreadPoolExecutor(4) as pool:
                list(pool.map(lambda _: sims.pop() and None, range(4)))
            self.assertEqual((sorted(freed), freed[-1]), ([0, 1, 2, 3, 4], 0))
            freed.clear()

    def test_a_forked_process_frees_nothing(self):
        freed = []
        owned = Owned(7, freed.append)
        child = os.fork()
        if child == 0:
            del owned
            os._exit(len(freed))
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), 0)
        del owned
        self.assertEqual(freed, [7])


if __name__ == "__main__":
    main()
