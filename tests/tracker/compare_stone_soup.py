"""Stone Soup's trackers on the detections of tests/tracker/close_scenes.h.

    python3 -m venv VENV && VENV/bin/pip install stonesoup==1.9 ortools
    VENV/bin/python tests/tracker/compare_stone_soup.py PROGRAM [SCENE ...] [--seeds N] [--tune N]

PROGRAM is test_tracker_close_objects: it writes the detections and scores the tracks, so that both
trackers are judged by the same code. GNN (two-dimensional assignment), JPDA and MFA (multi-frame
assignment) are tuned per scene by the mean GOSPA of the first `--tune` seeds: each of SETTINGS in
turn takes the best of its values of CHOICES, and the next kind begins with the settings of the one
before. They then run with the best from seed `--first` on, over `--seeds`. `--tune 0` tunes nothing;
`--vary NAME ...` tunes only these; `--settings NAME=VALUE ...` is where the search begins;
`--kinds gnn jpda` leaves out MFA, which is the slowest; `--each` prints the figures of each seed as
well. Stone Soup knows the motion model, the true density of false alarms and the covariance of each
detection.
"""

import argparse
import datetime
import subprocess
import time

import numpy as np
from stonesoup.dataassociator.mfa import MFADataAssociator
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.dataassociator.probability import JPDAwithEHM
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.functions import gm_reduce_single
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.mfa import MFAHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import (CombinedLinearGaussianTransitionModel,
                                                ConstantVelocity)
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.array import StateVectors
from stonesoup.types.detection import Detection, MissedDetection
from stonesoup.types.hypothesis import SingleDistanceHypothesis, SingleProbabilityHypothesis
from stonesoup.types.mixture import GaussianMixture
from stonesoup.types.multihypothesis import MultipleHypothesis
from stonesoup.types.numeric import Probability
from stonesoup.types.state import GaussianState, TaggedWeightedGaussianState
from stonesoup.types.update import GaussianMixtureUpdate, GaussianStateUpdate
from stonesoup.updater.kalman import KalmanUpdater

START = datetime.datetime(2000, 1, 1)
FIELD_PX = 512.0
# false alarms per frame and probability of detection of each scene, as in close_scenes.h
SCENES = {"formation7": (1, 0.95), "formation12": (10, 0.95), "crossings": (5, 0.95),
          "clutter": (30, 0.9), "dropped": (5, 0.8), "dim_crossings": (10, 0.97)}
# rate: sigma of a new track's rate, px/s; points: detections that confirm a track; patience: frames
# without one that end it, and `hold` one that is not confirmed; noise: of the process, px/s^1.5 (that
# of our tracker is 0.02 arcsec/s^1.5 at 3 arcsec a pixel, 0.0067; more of it allows for merged
# detections); gate: Mahalanobis distance; density: factor of that of false alarms; likelihood: 1: GNN
# and the initiator compare probabilities, 0: distances
SETTINGS = {"rate": 6.0, "hold": 2, "likelihood": 0, "points": 3, "patience": 4, "gate": 4.0,
            "noise": 0.0067, "density": 1.0}
CHOICES = {"rate": (2.0, 3.5), "hold": (3, 4), "likelihood": (1,), "points": (2, 4),
           "patience": (2, 7, 10, 30), "gate": (3.0, 5.0, 7.0),
           "noise": (0.001, 0.02, 0.05, 0.1, 0.2), "density": (0.3, 3.0)}
KINDS = ("gnn", "jpda", "mfa")
FIGURES = ("gospa_px", "ospa2_px", "ghosts", "purity", "switches", "coverage", "false_tracks")


def read_scene(program, scene, seed):
    """Detections of each frame."""
    text = subprocess.run([program, "write", scene, str(seed)], check=True, capture_output=True,
                          text=True).stdout
    frames = [set() for _ in range(60)]
    PLACES.clear()
    for line in text.splitlines():
        frame, x, y, sigma, _, _ = (float(word) for word in line.split())
        model = LinearGaussian(4, (0, 2), np.diag([sigma**2, sigma**2]))
        when = START + datetime.timedelta(seconds=frame)
        detection = Detection([[x], [y]], timestamp=when, measurement_model=model)
        PLACES[detection] = x, y, sigma**2
        frames[int(frame)].add(detection)
    return frames


def tagged(state, weight, tag):
    return TaggedWeightedGaussianState(state.state_vector, state.covar, timestamp=state.timestamp,
                                       weight=weight, tag=tag)


def gated(base):
    """A hypothesiser that sees no detection beyond its gate: the same hypotheses, sooner."""
    class Gated(base):
        """Of linear measurements of x and y with a round covariance."""

        def hypothesise(self, track, detections, timestamp, **kwargs):
            """Hypotheses of a track."""
            state = self.predictor.predict(track, timestamp=timestamp)
            mean, covar = np.asarray(state.state_vector, float), np.asarray(state.covar, float)
            xx, xy, yy = covar[0, 0], covar[0, 2], covar[2, 2]
            near = set()
            for d in detections:
                x, y, variance = PLACES[d]
                x, y = x - mean[0, 0], y - mean[2, 0]
                a, b = xx + variance, yy + variance
                if b * x * x - 2 * xy * x * y + a * y * y <= self.limit2 * (a * b - xy * xy):
                    near.add(d)
            if near:
                return super().hypothesise(track, near, timestamp, **kwargs)
            missed = MissedDetection(timestamp=timestamp)
            if base is DistanceHypothesiser:
                return MultipleHypothesis([SingleDistanceHypothesis(state, missed,
                                                                    self.missed_distance)])
            return MultipleHypothesis([SingleProbabilityHypothesis(
                state, missed, Probability(1 - self.prob_detect * self.prob_gate))],
                normalise=self.normalise)
    return Gated


GatedDistance, GatedPda = gated(DistanceHypothesiser), gated(PDAHypothesiser)
PLACES = {}  # x, y and variance of each detection of the scene


class Tracker:
    """A tracker of Stone Soup's parts."""

    def __init__(self, kind, scene, settings):
        alarms, probability = SCENES[scene]
        density = settings["density"] * max(alarms, 0.1) / FIELD_PX**2
        axis, gate = ConstantVelocity(settings["noise"]**2), settings["gate"]
        self.kind = kind
        self.predictor = KalmanPredictor(CombinedLinearGaussianTransitionModel([axis, axis]))
        self.updater = KalmanUpdater(None)
        near = GatedDistance(self.predictor, self.updater, Mahalanobis(), missed_distance=gate)
        likely = GatedPda(self.predictor, self.updater, clutter_spatial_density=density,
                          prob_detect=probability, prob_gate=1 - np.exp(-0.5 * gate**2))
        near.limit2 = likely.limit2 = 1.001 * gate**2
        single = GNNWith2DAssignment(likely if settings["likelihood"] else near)
        if kind == "gnn":
            self.associator = single
        elif kind == "jpda":
            self.associator = JPDAwithEHM(likely)
        else:
            self.associator = MFADataAssociator(MFAHypothesiser(likely), slide_window=3)
        prior = GaussianState([[0], [0], [0], [0]], np.diag([1, settings["rate"]**2] * 2))
        self.initiator = MultiMeasurementInitiator(
            prior, deleter=UpdateTimeStepsDeleter(settings["hold"]), data_associator=single,
            updater=self.updater, min_points=settings["points"])
        self.deleter = UpdateTimeStepsDeleter(settings["patience"])
        self.tracks = set()

    def mixture(self, hypotheses, when):
        """Update of a track of multi-frame assignment."""
        parts = []
        for hypothesis in hypotheses:
            state = self.updater.update(hypothesis) if hypothesis else hypothesis.prediction
            parts.append(tagged(state, hypothesis.prediction.weight, hypothesis.prediction.tag))
        best = max(hypotheses, key=lambda h: float(h.prediction.weight))
        hit = bool(best)
        mixture = GaussianMixture(parts)
        return (GaussianMixtureUpdate(hypothesis=hypotheses, components=parts) if hit
                else mixture), best.measurement if hit else None

    def step(self, detections, when):
        """One frame."""
        free = set(detections)
        joint = self.associator.associate(self.tracks, detections, when)
        for track, hypothesis in joint.items():
            if self.kind == "gnn":
                if hypothesis:
                    track.append(self.updater.update(hypothesis))
                    free.discard(hypothesis.measurement)
                else:
                    track.append(hypothesis.prediction)
            elif self.kind == "jpda":
                states = [self.updater.update(h) if h else h.prediction for h in hypothesis]
                weights = np.array([float(h.probability) for h in hypothesis])
                mean, covar = gm_reduce_single(
                    StateVectors([s.state_vector for s in states]),
                    np.stack([s.covar for s in states], axis=2), weights / weights.sum())
                missed = next(h.probability for h in hypothesis if not h)
                hits = [h for h in hypothesis if h and h.probability > missed]
                free -= {h.measurement for h in hits}
                if hits:
                    track.append(GaussianStateUpdate(mean, covar, hypothesis, timestamp=when))
                else:
                    track.append(GaussianState(mean, covar, timestamp=when))
            else:
                state, taken = self.mixture(hypothesis, when)
                track.append(state)
                free.discard(taken)
        self.tracks -= self.deleter.delete_tracks(self.tracks)
        for track in self.initiator.initiate(free, when):
            if self.kind == "mfa":
                track.append(GaussianMixtureUpdate(
                    hypothesis=track.state.hypothesis,
                    components=[tagged(track.state, Probability(1), [])]))
            self.tracks.add(track)

    def places(self):
        """Identity and position of each track."""
        for track in self.tracks:
            state = track.state
            if self.kind == "mfa":
                state = max(state.components, key=lambda c: float(c.weight))
            yield track.id, float(state.state_vector[0]), float(state.state_vector[2])


def run(program, kind, scene, seed, settings):
    """Figures of a scene, and processor time per frame in microseconds."""
    tracker, lines, names = Tracker(kind, scene, settings), [], {}
    frames = read_scene(program, scene, seed)
    before = time.process_time()
    for frame, detections in enumerate(frames):
        tracker.step(detections, START + datetime.timedelta(seconds=frame))
        for name, x, y in tracker.places():
            number = names.setdefault(name, len(names) + 1)
            lines.append(f"{frame} {number} {x:.6f} {y:.6f}")
    spent = time.process_time() - before
    words = subprocess.run([program, "score", scene, str(seed)], input="\n".join(lines), check=True,
                           capture_output=True, text=True).stdout.split()
    figures = {name: float(words[words.index(name) + 1]) for name in FIGURES}
    figures["us_per_frame"] = 1e6 * spent / len(frames)
    return figures


def mean(results, name):
    total = sum(r[name] for r in results)
    return total if name in ("ghosts", "switches", "false_tracks") else total / len(results)


def tuned(program, kind, scene, start, arguments):
    """Settings with the lowest mean GOSPA of the seeds to tune with, from those of the start on."""
    def cost(settings):
        gospa = mean([run(program, kind, scene, seed, settings) for seed in range(arguments.tune)],
                     "gospa_px")
        if arguments.each:
            print("tune", scene, kind, f"{gospa:.4f}", settings, flush=True)
        return gospa

    names = arguments.vary or SETTINGS
    best, lowest = start, cost(start)
    for name in names:
        if name == "density" and kind == "gnn" and not best["likelihood"]:
            continue
        for value in CHOICES[name]:
            other = {**best, name: value}
            if other != best and (gospa := cost(other)) < lowest:
                best, lowest = other, gospa
    return best


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--tune", type=int, default=1)
    parser.add_argument("--vary", nargs="+", choices=SETTINGS)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--settings", nargs="+", default=[], metavar="NAME=VALUE")
    parser.add_argument("--each", action="store_true")
    arguments = parser.parse_args()
    given = dict(pair.split("=") for pair in arguments.settings)
    given = {name: type(SETTINGS[name])(value) for name, value in given.items()}
    for scene in arguments.scenes or SCENES:
        best = {**SETTINGS, **given}
        for kind in arguments.kinds:
            if arguments.tune:
                best = tuned(arguments.program, kind, scene, best, arguments)
            results = []
            for seed in range(arguments.first, arguments.first + arguments.seeds):
                results.append(run(arguments.program, kind, scene, seed, best))
                if arguments.each:
                    print(scene, kind, seed, *(f"{name} {value:.4g}"
                                               for name, value in results[-1].items()), flush=True)
            if results:
                print(scene, kind, best,
                      *(f"{name} {mean(results, name):.4g}" for name in results[0]), flush=True)


if __name__ == "__main__":
    main()
