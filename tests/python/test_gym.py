"""Environments of boresight.gym. What needs Gymnasium is left out where it is not installed."""
import unittest
import warnings

import numpy as np

from support import bst, main
import boresight.gym as bg

with_gymnasium = unittest.skipUnless(bg.HAS_GYMNASIUM, "gymnasium is not installed")


class Pointing(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = bg.pointing.pointing_model(bg.pointing.default_scenario().with_(duration_s=40))

    def course(self, env, seed, steps=6):
        """Observations, rewards and truth of some steps."""
        first, info = env.reset(seed=seed)
        out = [(first["detections"].tobytes(), info["error_px"])]
        for k in range(steps):
            observation, reward, _, _, info = env.step(np.array([0.1 * k, -0.2], np.float32))
            out.append((observation["detections"].tobytes(), reward, info["error_px"]))
        return out

    @with_gymnasium
    def test_the_checker_of_gymnasium_passes(self):
        from gymnasium.utils.env_checker import check_env
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            check_env(bg.PointingEnv(model=self.model, render_mode="rgb_array"))

    @with_gymnasium
    def test_it_is_registered(self):
        import gymnasium
        env = gymnasium.make("boresight/Pointing-v0", model=self.model)
        self.assertIsInstance(env.unwrapped, bg.PointingEnv)

    def test_a_seed_is_a_run(self):
        env = bg.PointingEnv(model=self.model)
        self.assertEqual(self.course(env, 3), self.course(env, 3))
        self.assertNotEqual(self.course(env, 3), self.course(env, 4))

    def test_an_action_turns_the_boresight(self):
        env = bg.PointingEnv(model=self.model, offset_px=0)
        env.reset(seed=1)
        def object_px():
            items = env.simulation.truth.items
            item = items[items["kind"] == 1][0]
            return np.array([item["x_mid_px"], item["y_mid_px"]])
        for _ in range(2):
            env.step(np.zeros(2, np.float32))
        drift = -object_px()
        env.step(np.zeros(2, np.float32))
        drift += object_px()
        env.step(np.array([1, 0], np.float32))
        env.step(np.zeros(2, np.float32))
        before = object_px()
        env.step(np.zeros(2, np.float32))
        moved = object_px() - before - drift
        # 20 px per frame along +x, which moves the image along -x; the mount's noise is some pixels
        self.assertAlmostEqual(moved[0], -20, delta=6)
        self.assertAlmostEqual(moved[1], 0, delta=6)

    def test_baselines_are_in_order(self):
        env = bg.PointingEnv(model=self.model, offset_px=100)
        random = bg.score(env, bg.random_policy(), runs=[1, 2])
        greedy = bg.score(env, bg.greedy_policy(env), runs=[1, 2])
        self.assertLess(random, 0.1)
        self.assertGreater(greedy, 0.3)

    @with_gymnasium
    def test_the_vector_is_its_environments(self):
        vector = bg.PointingVectorEnv(3, model=self.model)
        observations, infos = vector.reset(seed=5)
        single = bg.PointingEnv(model=self.model)
        actions = np.array([[0.5, 0], [0, 0.5], [-0.5, 0.1]], np.float32)
        for number in range(3):
            first, info = single.reset(seed=5 + number)
            np.testing.assert_array_equal(observations["detections"][number], first["detections"])
            self.assertEqual(infos["error_px"][number], info["error_px"])
        stepped = [vector.step(actions)[:2] for _ in range(4)]
        single.reset(seed=6)
        for observation, reward in stepped:
            one, own, _, _, _ = single.step(actions[1])
            np.testing.assert_array_equal(observation["detections"][1], one["detections"])
            self.assertEqual(reward[1], own)
        vector.close()

    @with_gymnasium
    def test_the_vector_starts_ended_ones_anew(self):
        vector = bg.PointingVectorEnv(2, model=self.model, patience=1)
        vector.reset(seed=1)
        ended = np.zeros(2, bool)
        for _ in range(60):
            _, reward, terminated, truncated, _ = vector.step(np.ones((2, 2), np.float32))
            self.assertTrue(np.all(reward[ended] == 0))
            if ended.any():
                break
            ended = terminated | truncated
        self.assertTrue(ended.any())
        vector.close()

    @with_gymnasium
    def test_many_environments_have_one_pool_of_threads(self):
        before = len(os.listdir("/proc/self/task"))
        vector = bg.PointingVectorEnv(24, model=self.model, threads=3)
        vector.reset(seed=1)
        vector.step(np.zeros((24, 2), np.float32))
        self.assertLessEqual(len(os.listdir("/proc/self/task")), before + 2)  # and this one
        vector.close()

    @with_gymnasium
    def test_the_vector_refuses_wrong_actions(self):
        vector = bg.PointingVectorEnv(2, model=self.model)
        with self.assertRaises(bst.ArgumentError):
            vector.step(np.zeros((2, 2)))
        vector.reset(seed=1)
        for wrong in (np.zeros(2), np.zeros((3, 2)), np.full((2, 2), np.nan)):
            with self.assertRaises(bst.ArgumentError):
                vector.step(wrong)
        vector.close()

    def test_misuse_raises(self):
        env = bg.PointingEnv(model=self.model)
        with self.assertRaises(bst.ArgumentError):
            env.step(np.zeros(2))
        env.reset(seed=1)
        for wrong in (np.zeros(3), [np.nan, 0], None, "x"):
            with self.assertRaises((bst.ArgumentError, ValueError, TypeError)):
                env.step(wrong)
        with self.assertRaises(bst.ArgumentError):
            bg.PointingEnv(model=self.model, render_mode="human")


class Tasking(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = bg.TaskingModel(
            bst.Scenario.load("constellation_quick.json").with_(duration_s=60), targets=12)

    @with_gymnasium
    def test_the_checker_of_gymnasium_passes(self):
        from gymnasium.utils.env_checker import check_env
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            check_env(bg.TaskingEnv(model=self.model))

    def test_the_catalogue_is_where_the_objects_are(self):
        # true range and direction of a target in the field, against the propagated table
        catalogue = self.model.catalogue
        env = bg.TaskingEnv(model=self.model)
        env.reset(seed=1)
        first = [int(np.argmax(row[:, 1] - row[:, 0])) for row in
                 env._observe(env._sim)["targets"]]
        env.step(np.array(first))
        found = 0
        for scope, target in zip(env.sensors, first):
            truth = env._sim.view("truth", scope)
            items = truth.items[truth.items["norad"] == catalogue.norad[target]]
            for item in items:
                ra, dec = item["ra_rad"], item["dec_rad"]
                sight = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
                middle = 0.5 * (truth.start_tick + truth.end_tick) / env._sim.tick_rate_hz
                place = truth.observer_gcrf_m + item["range_m"] * sight
                # m: light takes 0.14 s, in which the satellite moves by 3 km/s in an Earth that
                # moves by 30 km/s; the true direction contains both
                self.assertLess(np.linalg.norm(place - catalogue.at(middle)[target]), 5500)
                found += 1
        self.assertGreater(found, 1)

    def test_greedy_is_better_than_random(self):
        env = bg.TaskingEnv(model=self.model)
        random = bg.tasking_score(env, bg.random_tasks(env), runs=[1])
        greedy = bg.tasking_score(env, bg.greedy_tasks(env), runs=[1])
        self.assertGreaterEqual(greedy, 3)
        self.assertGreater(greedy, random)
        self.assertLessEqual(greedy, 12)
        self.assertGreater(bg.builtin_tasking_score(env, runs=[1]), 1)

    def test_whole_numbers_of_seconds_are_times_too(self):
        env = bg.TaskingEnv(model=self.model, decision_s=10, revisit_s=150)
        env.reset(seed=1)
        _, _, _, _, info = env.step(np.zeros(5, int))
        self.assertEqual(info["age_s"].dtype, np.float64)

    def courses(self, action):
        """Twice the same steps of the run number 7."""
        env = bg.TaskingEnv(model=self.model, decision_s=5, revisit_s=150)
        course = []
        for _ in range(2):
            env.reset(seed=7)
            course.append([env.step(action)[:2] for _ in range(2)])
        return course

    def check_same(self, course):
        for other in course[1:]:
            for (a, reward), (b, same) in zip(course[0], other):
                np.testing.assert_array_equal(a["targets"], b["targets"])
                self.assertEqual(reward, same)

    def test_a_seed_is_a_run(self):
        self.check_same(self.courses(np.array([1, 2, 3, 4, 5])))

    @with_gymnasium
    def test_the_vector_is_its_environments(self):
        action = np.array([1, 2, 3, 4, 5])
        course = self.courses(action)
        vector = bg.TaskingVectorEnv(2, model=self.model)
        vector.reset(seed=6)
        course.append([[{k: v[1] for k, v in o.items()}, r[1]] for o, r in
                       (vector.step(np.array([action, action]))[:2] for _ in range(2))])
        self.check_same(course)
        vector.close()

    def test_misuse_raises(self):
        env = bg.TaskingEnv(model=self.model)
        with self.assertRaises(bst.ArgumentError):
            env.step(np.zeros(5, int))
        env.reset(seed=1)
        for wrong in (np.zeros(4, int), np.full(5, 12), np.full(5, -1), np.zeros(5), "x", None):
            with self.assertRaises(bst.ArgumentError):
                env.step(wrong)
        with self.assertRaises(bst.ArgumentError):
            bg.TaskingModel("neossat_geo_track.json")


class Plain(unittest.TestCase):
    """Environments where Gymnasium is not installed."""

    def test_spaces_contain_what_they_sample(self):
        from boresight.gym.base import PlainSpaces
        box = PlainSpaces.Box(-1, 1, (2, 3), np.float32)
        numbers = PlainSpaces.MultiDiscrete([4, 9])
        both = PlainSpaces.Dict({"a": box, "b": numbers})
        for space in (box, numbers, both):
            for _ in range(20):
                self.assertTrue(space.contains(space.sample()))
        for space, wrong in ((box, np.full((2, 3), 2, np.float32)), (box, np.zeros((2, 3))),
                             (box, np.zeros(3, np.float32)), (box, "x"), (numbers, [4, 0]),
                             (numbers, [-1, 0]), (numbers, [0.5, 0]), (both, {"a": box.sample()})):
            self.assertFalse(space.contains(wrong))

    def test_it_says_what_needs_gymnasium(self):
        if not bg.HAS_GYMNASIUM:
            with self.assertRaisesRegex(ImportError, r"pip install boresight\[gym\]"):
                bg.TaskingVectorEnv

    def test_observations_are_in_their_spaces(self):
        env = bg.PointingEnv(model=bg.pointing.pointing_model(
            bg.pointing.default_scenario().with_(duration_s=20)))
        observation, _ = env.reset(seed=1)
        self.assertTrue(env.observation_space.contains(observation))
        self.assertTrue(env.observation_space.contains(env.step(env.action_space.sample())[0]))


if __name__ == "__main__":
    main()
