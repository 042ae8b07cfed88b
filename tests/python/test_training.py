import json
import pathlib
import subprocess
import sys
import threading
import unittest

import numpy as np

import support
import traceflow as tf

# Presses Ctrl-C at an iteration, then tells what it saw.
INTERRUPTED = """
import os, signal, sys
import traceflow as tf

def at_25(event):
    if event["event"] == "step" and event["iteration"] == 25:
        os.kill(os.getpid(), signal.SIGINT)

trainer = tf.Trainer(sys.argv[1], tf.TrainOptions("demo", iterations=int(sys.argv[3])), sys.argv[2], device="cpu")
try:
    trainer.run(at_25)
except KeyboardInterrupt:
    print("interrupted at", trainer.iteration)
"""


class Training(support.WithRun):
    def options(self, **more):
        return tf.TrainOptions("demo", iterations=support.ITERATIONS, **more)

    def trainer(self, name, **more):
        return tf.Trainer(tf.load_capture(self.capture_folder), self.options(**more), self.folder / name, device="cpu")

    def assert_is_the_run(self, folder):
        """Has the program's bytes in all tensors, and its metadata but for times."""
        (ours, own_data), (theirs, data) = support.checkpoint(folder), support.checkpoint(self.run_folder)
        self.assertEqual(list(ours), list(theirs))
        for name, tensor in theirs.items():
            self.assertEqual(ours[name], tensor, name)
        self.assertEqual(own_data, data)

    def test_gives_the_bytes_of_the_program_and_tells_its_events(self):
        trainer = self.trainer("own")
        events = []
        last = trainer.run(events.append)
        self.assert_is_the_run(self.folder / "own")
        self.assertEqual(last, events[-1])
        self.assertEqual((last["event"], last["ending"]), ("finished", "completed"))
        steps = [e for e in events if e["event"] == "step"]
        self.assertEqual([s["iteration"] for s in steps], list(range(1, support.ITERATIONS + 1)))
        # The log has every tenth step of them.
        log = [json.loads(line) for line in (self.folder / "own/log.jsonl").read_text().splitlines()]
        self.assertEqual(log, [e for e in events if e["event"] != "step" or e["iteration"] % 10 == 0])
        theirs = [json.loads(line) for line in (self.run_folder / "log.jsonl").read_text().splitlines()]
        self.assertEqual([e["event"] for e in log], [e["event"] for e in theirs])
        self.assertEqual([set(e) for e in log], [set(e) for e in theirs])

    def test_ctrl_c_saves_and_the_run_goes_on_to_the_same_bytes(self):
        folder = self.folder / "interrupted"
        done = subprocess.run([sys.executable, "-c", INTERRUPTED, self.capture_folder, folder, str(support.ITERATIONS)],
                              capture_output=True, text=True)
        self.assertEqual((done.stdout.strip(), done.returncode), ("interrupted at 25", 0), done.stderr)
        self.assertEqual(tf.load_scene(folder).iteration, 25)
        trainer = tf.Trainer(None, None, folder, resume=True, device="cpu")
        self.assertEqual(trainer.iteration, 25)
        trainer.run()
        self.assert_is_the_run(folder)

    def test_an_error_of_the_callback_saves_and_the_run_goes_on(self):
        trainer = self.trainer("raised")

        def fail(event):
            if event["event"] == "step" and event["iteration"] == 10:
                raise LookupError("of the caller")

        with self.assertRaisesRegex(LookupError, "of the caller"):
            trainer.run(fail)
        self.assertEqual(tf.load_scene(self.folder / "raised").iteration, 10)
        trainer.run()
        self.assert_is_the_run(self.folder / "raised")

    def test_shows_the_scene_live(self):
        trainer = self.trainer("live")
        view = tf.load_capture(self.capture_folder).test[0]
        pictures = []

        def look(event):
            if event["event"] == "step" and event["iteration"] in (1, support.ITERATIONS):
                pictures.append(trainer.scene().render(view)["rgb"])

        trainer.run(look)
        self.assert_is_the_run(self.folder / "live")
        first, last = pictures
        self.assertEqual(last.tobytes(), tf.load_scene(self.folder / "live").render(view)["rgb"].tobytes())
        self.assertGreater(np.abs(first - last).mean(), 0.01)

    def test_lets_other_threads_run_and_stop_it(self):
        trainer = self.trainer("stopped")
        refused = []

        def other():
            try:
                trainer.scene()
            except tf.Error as error:
                refused.append(str(error))
            trainer.stop()

        def start(event):
            if event["event"] == "step" and event["iteration"] == 5:
                threading.Thread(target=other).start()

        self.assertEqual(trainer.run(start)["ending"], "interrupted")
        self.assertEqual(len(refused), 1)
        self.assertLess(trainer.iteration, support.ITERATIONS)

    def test_steps_one_by_one(self):
        trainer = self.trainer("steps")
        losses = [trainer.step() for _ in range(5)]
        self.assertEqual(trainer.iteration, 5)
        self.assertIn("l1", losses[0]["terms"])
        self.assertGreater(losses[0]["loss"], 0)
        trainer.save()
        self.assertEqual(tf.load_scene(self.folder / "steps").iteration, 5)

    def test_leaves_the_capture_as_it_is(self):
        capture = tf.load_capture(self.capture_folder)
        before = [view.mask.copy() for view in capture.train]
        tf.Trainer(capture, self.options(), self.folder / "apart", device="cpu").step()
        for view, mask in zip(capture.train, before):
            np.testing.assert_array_equal(view.mask, mask)

    def test_errors_have_the_text_of_the_program(self):
        with self.assertRaises(tf.InputError) as caught:
            tf.Trainer(self.capture_folder, self.options(), self.run_folder)
        self.assertEqual(str(caught.exception),
                         support.error_of("train", "-d", self.capture_folder, "-o", self.run_folder))
        with self.assertRaises(tf.InputError) as caught:
            tf.Trainer(None, None, self.folder / "none", resume=True)
        self.assertEqual(str(caught.exception), support.error_of("train", "-o", self.folder / "none", "--resume"))
        with self.assertRaises(tf.InputError):
            tf.Trainer(None, self.options(), self.folder / "none")
        self.assertFalse(pathlib.Path(self.folder, "none").exists())


if __name__ == "__main__":
    unittest.main()
