"""Studies on other machines: parts that --gather brings together, and a scheduler of three commands,
make the tables of the local pool."""
import json
import os
import unittest

import runs


def write(folder, **changes):
    """A study of 12 short runs in 2 settings."""
    path = os.path.join(folder, "study.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"boresight_study": 1, "name": "small", "kind": "loop", "seed": "0x51",
                   "scenarios": [{"file": os.path.abspath("scenarios/day_generator.json")}],
                   "set": {"/duration_s": 30, "/world/star_catalogue": "embedded"},
                   "sweeps": [{"axes": [{"path": "/observers/0/sensors/0/camera/read_noise_e",
                                         "values": [5, 15]}]}], "replicates": 6, **changes}, file)
    return path


def study(*words, **options):
    return runs.call("study", *words, timeout=600, **options)


def tables(out):
    """The bytes of all tables but speed."""
    result = {}
    for name in ("runs.csv", "settings.csv", "statistics.csv"):
        with open(os.path.join(out, name), "rb") as file:
            result[name] = file.read()
    return result


class Elsewhere(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.path = write(cls.folder)
        cls.out = os.path.join(cls.folder, "out")
        runs.call_well("study", cls.path, "--out", cls.out, timeout=600)

    def test_parts_of_machines_without_a_shared_folder(self):
        parts = [os.path.join(self.folder, f"part{i}") for i in range(3)]
        for i, part in enumerate(parts):
            result = study(self.path, "--out", part, "--shard", "env/3",
                           env={**os.environ, "JOB_COMPLETION_INDEX": str(i)})
            self.assertEqual(result.returncode, 0, result.stderr)
        out = os.path.join(self.folder, "gathered")
        result = study(self.path, "--out", out, "--gather", *parts[:2])
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn("4 runs are missing", result.stdout)
        shard, = os.listdir(parts[2] + "/shards")
        with open(os.path.join(parts[2], "shards", shard), "r+b") as file:
            whole = file.read()
            file.seek(len(whole) // 2)
            file.write(b"x")
        result = study(out, "--gather", *parts)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn("it is left out", result.stderr)
        with open(os.path.join(parts[2], "shards", shard), "wb") as file:
            file.write(whole)
        result = study(out, "--gather", parts[2], parts[0])
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(tables(out), tables(self.out))
        other = study(write(runs.scratch(), seed="0x52"), "--out", os.path.join(self.folder, "other"),
                      "--gather", parts[0])
        self.assertEqual(other.returncode, 1)
        self.assertIn("belongs to another study", other.stderr)

    def test_scheduler_of_three_commands(self):
        """Jobs of a queue in a folder: the first attempt at runs 4 and 5 is killed in its midst."""
        jobs = os.path.join(self.folder, "jobs")
        os.mkdir(jobs)
        with open(os.path.join(self.folder, "scheduler.json"), "w", encoding="utf-8") as file:
            json.dump({
                "submit": f"cd {jobs}; job=$2.$$; [ $2 != 4:2 ] || [ -e killed ] || "
                          "{ touch killed; set -- 'sleep 0.1; kill -9 $$'; }; "
                          '(sh -c "$1" >$job.log 2>&1; echo $? >$job.ended) & echo queue says; '
                          "echo $job",
                "poll": f"cd {jobs}; for job; do if [ -e $job.ended ]; then case $(cat $job.ended) "
                        "in 0) echo $job done;; 137) echo $job lost by SIGKILL;; "
                        "*) echo $job failed $(tail -n 1 $job.log);; esac; "
                        "else echo $job running; fi; done",
                "cancel": "exit 1", "poll_s": 0.1}, file)
        out = os.path.join(self.folder, "scheduled")
        result = study(self.path, "--out", out, "--scheduler", file.name, "--shard-runs", "2")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("runs 4 to 5, attempt 1: by SIGKILL", result.stderr)
        self.assertEqual(tables(out), tables(self.out))
        self.assertEqual(sum(name.endswith(".log") for name in os.listdir(jobs)), 6 + 1)


if __name__ == "__main__":
    unittest.main()
