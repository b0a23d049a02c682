import contextlib
import sqlite3
import threading
import unittest

import numpy as np
import pandas

import palpate
from common import InFolder, figures, program, small_block, wander


class Records(InFolder):
    def setUp(self):
        super().setUp()
        self.file = self.folder / "r.db"
        with palpate.Session(small_block(), record=self.file, operator="P-17") as session:
            self.ticks = session.run(wander(2000))
            self.hash, self.total = session.force_hash, session.score()

    def test_a_table_of_it_has_the_program_s_columns(self):
        frame = palpate.Record(self.file).to_dataframe()
        self.assertEqual(len(frame), 2000)
        np.testing.assert_array_equal(frame[["total_x_n", "total_y_n", "total_z_n"]].to_numpy(), self.ticks["total"])
        np.testing.assert_array_equal(frame["seconds"], np.arange(2000) / 1000)
        np.testing.assert_array_equal(frame["distance_tumour_m"], self.ticks["distance"][:, 0])

    def test_its_samples_give_the_session_again(self):
        record = palpate.Record(self.file)
        again = palpate.Session(record.model())
        np.testing.assert_array_equal(again.run(**record.samples), record.ticks)
        self.assertEqual(again.force_hash, self.hash)

    def test_a_record_of_another_rate_runs_and_is_recorded_at_its_rate(self):
        file, again = self.folder / "p500.db", self.folder / "again.db"
        program("stability", "--case", "plate-1mm/spring/touch/grip/500", "--record", file)
        record = palpate.Record(file)
        model = record.model()
        self.assertEqual(model.rate, 500)
        with palpate.Session(model, record=again) as session:
            np.testing.assert_array_equal(session.run(**record.samples), record.ticks)
            self.assertEqual(session.force_hash, record.replay()["force_hash"])
            with self.assertRaisesRegex(palpate.Error, "500 Hz"):
                session.perform()
        self.assertEqual(palpate.Record(again).info["rate"], 500)
        self.assertTrue(palpate.Record(again).replay()["identical"])

    def test_a_probe_s_moves_are_part_of_its_poses(self):
        file = self.folder / "p.db"
        scene = palpate.Scene.parse(palpate.Scene("block").changed({"volume.voxel_mm": 3, "model.setting": "fast"}).text + """
[probe]
kind = "linear"
face_mm = [0, 0, 0]
direction = [0, 1, 0]
lateral = [1, 0, 0]
""")
        poses = np.zeros((600, 12))
        poses[:, 1] = -0.03
        poses[:, 4] = 1
        poses[:, 6] = np.minimum(np.arange(600) * 1e-5, 3e-3)
        with palpate.Session(scene, record=file) as session:
            ticks = session.run(poses)
        np.testing.assert_array_equal(ticks["probe_move"][:, 0], poses[:, 6])
        np.testing.assert_allclose(ticks["probe_face"][:, 1], poses[:, 6], atol=1e-12)
        self.assertLess(ticks["probe_force"][-1, 1], -0.05)
        record = palpate.Record(file)
        self.assertEqual(record.poses.shape, (600, 12))
        np.testing.assert_array_equal(palpate.Session(record.model()).run(**record.samples), record.ticks)
        self.assertIn("probe_press_m", record.to_dict())
        self.check_columns(file)

    def check_columns(self, file):
        """Every column of the file's own table is one of to_dict(), with the same values, as its documentation says."""
        record = palpate.Record(file)
        ours = record.to_dict()
        with contextlib.closing(sqlite3.connect(file)) as database:
            theirs = pandas.read_sql("SELECT * FROM ticks", database)
        for i, name in enumerate(record.info["structures"]):
            theirs = theirs.rename(columns={f"{what}_{i}_m": f"{what}_{name}_m" for what in ("distance", "ahead")})
        kept = [column for column in theirs if not column.endswith("_us") and column != "seconds"]
        self.assertEqual(set(kept) - set(ours), set())
        for column in kept:
            values = theirs[column].fillna(-1) if column in ("nearest_vital", "warned") else theirs[column]
            if column in ("phase", "warning"):
                values = values.map({"phase": palpate.PHASES, "warning": palpate.WARNINGS}[column].index)
            np.testing.assert_array_equal(ours[column], values.to_numpy(), column)
        self.assertEqual({column for column in set(ours) - set(kept) if "probe" not in column and "beam" not in column}, {"events"})

    def test_columns_are_those_of_the_file(self):
        self.check_columns(self.file)

    def test_replay_and_score_are_the_program_s(self):
        record = palpate.Record(self.file)
        theirs = figures("replay", self.file)
        ours = record.replay()
        self.assertTrue(ours["identical"])
        self.assertEqual(ours["force_hash"], theirs["force_hash"])
        score = figures("score", self.file)["sessions"][0]
        compared = 0
        for measure, value in palpate.score(self.file).items():
            if isinstance(value, (int, float)):
                theirs = score[measure]
                self.assertTrue(theirs == value or (theirs is None and not np.isfinite(value)), measure)
                compared += 1
        self.assertGreater(compared, 20)
        self.assertEqual(record.score()["total"], score["total"])
        self.assertEqual(self.total["total"], score["total"])

    def test_threads_may_share_it(self):
        record = palpate.Record(self.file)
        totals, rows = [], []

        def read():
            for _ in range(4):
                totals.append(record.score()["total"])
                rows.append(len(palpate.Record(self.file).ticks))
                self.assertTrue(record.complete)

        threads = [threading.Thread(target=read) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(totals, [self.total["total"]] * 16)
        self.assertEqual(rows, [2000] * 16)

    def test_it_says_who_and_what(self):
        record = palpate.Record(self.file)
        self.assertEqual(record.info["operator"], "P-17")
        self.assertEqual(record.info["device"], "python")
        self.assertEqual(record.info["scene"], "block")
        self.assertTrue(record.complete)
        self.assertEqual(record.results["force_hash"], self.hash)
        self.assertEqual(palpate.Scene.parse(record.scene_text).name, "block")

    def test_a_record_is_never_written_over(self):
        with self.assertRaisesRegex(palpate.Error, "r.db"):
            palpate.Session(small_block(), record=self.file)
        self.assertEqual(len(palpate.Record(self.file)), 2000)

    def test_a_score_is_of_what_a_file_may_be_called(self):
        self.assertEqual(palpate.score(str(self.file).encode())["total"], palpate.score(self.file)["total"])
        odd = self.folder / "r\udce4.db"
        self.file.rename(odd)
        self.assertEqual(palpate.Record(odd).file, str(odd))
        with self.assertRaisesRegex(palpate.Error, "none\udce4.db: "):
            palpate.score(self.folder / "none\udce4.db")
        for wrong in (3, None):
            with self.assertRaisesRegex(TypeError, "score: give a Record"):
                palpate.score(wrong)

    def test_what_is_no_record_is_refused(self):
        (self.folder / "no.db").write_text("no record")
        with self.assertRaisesRegex(palpate.Error, "no.db"):
            palpate.Record(self.folder / "no.db")


class Removed(InFolder):
    def test_a_record_that_was_removed_is_missed(self):
        session = palpate.Session(small_block(), record=self.folder / "r.db")
        session.run(wander(10))
        (self.folder / "r.db").unlink()
        with self.assertRaisesRegex(palpate.Error, "r.db: was removed or moved while it was written"):
            session.close()


if __name__ == "__main__":
    unittest.main()
