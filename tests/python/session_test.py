import unittest

import numpy as np

import palpate
from common import InFolder, figures, small_block, wander


class Run(InFolder):
    def test_ten_thousand_poses_have_the_bits_of_palpate_replay(self):
        record = self.folder / "r.db"
        with palpate.Session(small_block(), record=record) as session:
            ticks = session.run(wander(10000))
        replayed = figures("replay", record)
        self.assertTrue(replayed["identical"])
        self.assertEqual(replayed["ticks"], 10000)
        self.assertEqual(replayed["force_hash"], session.force_hash)
        recorded = palpate.Record(record)
        for field in ticks.dtype.names:
            np.testing.assert_array_equal(ticks[field], recorded.ticks[field], field)
        np.testing.assert_array_equal(session.events, recorded.events)
        self.assertGreater(np.linalg.norm(ticks["tissue_force"], axis=1).max(), 0.15)

    def test_steps_and_any_pieces_of_a_run_are_one_run(self):
        poses = wander(2500, seed=2)
        whole = palpate.Session(small_block()).run(poses)
        session = palpate.Session(small_block())
        first = session.run(poses[:700])
        self.assertEqual(session.advance(poses[700:1100]), 400)
        stepped = [session.step(pose) for pose in poses[1100:1600]]
        last = session.run(poses[1600:])
        np.testing.assert_array_equal(first, whole[:700])
        np.testing.assert_array_equal([s.total for s in stepped], whole["total"][1100:1600])
        np.testing.assert_array_equal([s.tissue_force for s in stepped], whole["tissue_force"][1100:1600])
        self.assertEqual([s.events for s in stepped], whole["events"][1100:1600].tolist())
        np.testing.assert_array_equal(last, whole[1600:])

    def test_the_force_pushes_the_ball_out_and_grows_with_depth(self):
        model = small_block()
        radius = 1e-3 * model.scene.to_dict()["tool"]["radius_mm"]
        path = palpate.press_path([0, -radius, 0], [0, 1, 0], 4e-3)
        ticks = palpate.Session(model).run(path)
        depth = ticks["position"][:, 1] + radius
        down = slice(np.argmax(depth > 0), np.argmax(depth))
        force = -ticks["tissue_force"][down, 1]
        self.assertTrue(np.all(np.diff(force) > -1e-3 * force.max()))
        self.assertGreater(force[-1], 0.1)
        np.testing.assert_allclose(ticks["tissue_force"][down][:, [0, 2]], 0, atol=0.05 * force.max())
        self.assertTrue(np.all(ticks["tissue_force"][depth < -0.5e-3] == 0))

    def test_without_the_dead_man_switch_nothing_is_sent(self):
        ticks = palpate.Session(small_block()).run(wander(1500), buttons=0)
        self.assertTrue(np.all(ticks["total"] == 0))
        self.assertGreater(np.abs(ticks["tissue_force"]).max(), 0)

    def test_events_are_those_of_the_mask(self):
        session = palpate.Session(small_block())
        ticks = session.run(wander(3000))
        mask = np.zeros(3000, np.uint32)
        for event in session.events:
            mask[event["tick"]] |= 1 << int(event["kind"])
        np.testing.assert_array_equal(mask, ticks["events"])
        self.assertIn("contact", {palpate.EVENTS[k] for k in session.events["kind"]})

    def test_a_pose_that_is_none_is_marked_and_not_followed(self):
        poses = wander(1000)
        poses[500] = np.nan
        ticks = palpate.Session(small_block()).run(poses)
        np.testing.assert_array_equal(ticks["position"][500], poses[499])
        self.assertFalse(ticks["fresh"][500])
        self.assertTrue(np.all(np.isfinite(ticks["total"])))

    def test_an_axis_of_any_length_is_normalised(self):
        session, poses = palpate.Session(small_block()), np.zeros((3, 6))
        poses[:, 4] = [2.0, 2e200, 2e-200]
        np.testing.assert_array_equal(session.run(poses)["axis"], [[0, 1, 0]] * 3)
        plain = palpate.press_path([0, 0, 0], [0, 1, 0], 1e-3)
        for length in 1e200, 1e-200:
            np.testing.assert_array_equal(palpate.press_path([0, 0, 0], [0, length, 0], 1e-3), plain)

    def test_a_path_down_has_whole_steps_and_its_lowest_point_once(self):
        # Of these depths some are so many steps but for rounding, whose last point was there twice.
        for depth in np.arange(100) * 1e-4:
            for speed, lead in (0.02, 1e-3), (0.1, 0.0), (0.03, 0.5e-3):
                with self.subTest(depth=depth, speed=speed):
                    y = palpate.press_path([0, 0, 0], [0, 1, 0], depth, speed=speed, lead=lead, hold=0)[600:, 1]
                    down = y[:len(y) // 2]
                    steps = np.diff(down) / (1e-3 * speed)
                    self.assertEqual((down[-1], down[::-1].tolist()), (depth, y[len(y) // 2:].tolist()))
                    np.testing.assert_allclose(steps[:-1], 1, rtol=1e-9)
                    self.assertTrue(np.all((steps > 1e-4) & (steps < 1 + 1e-5)), steps)

    def test_a_path_of_what_is_no_number_is_refused(self):
        for wrong in np.nan, np.inf, -np.inf:
            for arguments in [((wrong, 0, 0), (0, 1, 0), 1e-3), ((0, 0, 0), (0, wrong, 0), 1e-3), ((0, 0, 0), (0, 1, 0), wrong)]:
                with self.subTest(arguments=arguments), self.assertRaisesRegex(ValueError, "finite"):
                    palpate.press_path(*arguments)
            for name in "speed", "hold", "lead":
                with self.subTest(name, wrong=wrong), self.assertRaisesRegex(ValueError, "finite"):
                    palpate.press_path((0, 0, 0), (0, 1, 0), 1e-3, **{name: wrong})

    def test_a_path_that_no_memory_holds_is_refused(self):
        for name, wrong in [("speed", 1e-9), ("speed", 5e-324), ("hold", 1e9), ("lead", 1e9), ("depth", 1e300)]:
            arguments = {"depth": 1e-3, name: wrong}
            with self.subTest(arguments), self.assertRaisesRegex(ValueError, "^press_path: the path would have .* ticks"):
                palpate.press_path((0, 0, 0), (0, 1, 0), **arguments)

    def test_an_operator_that_no_record_takes_is_refused_without_one_too(self):
        for wrong in "two\nlines", "x" * 201:
            with self.subTest(wrong), self.assertRaisesRegex(ValueError, "^operator: the operator has "):
                palpate.Session(small_block(), operator=wrong)

    def test_views_of_a_models_volume_share_one_array(self):
        model = palpate.Model(small_block())
        self.assertTrue(np.shares_memory(model.volume.labels, model.volume.labels))
        self.assertTrue(np.shares_memory(model.volume.stiffness, model.volume.stiffness))

    def test_a_path_of_what_is_no_point_is_refused(self):
        for name in ("start", "direction"):
            for wrong in ([1], [1, 2], [[0, 1, 0]], np.zeros((3, 1)), 1.0, None, "abc", np.zeros(3, complex), [1, [2], 3]):
                arguments = {"start": (0, 0, 0), "direction": (0, 1, 0), "depth": 1e-3, name: wrong}
                with self.subTest(arguments), self.assertRaisesRegex(ValueError, f"^{name}: give three numbers"):
                    palpate.press_path(**arguments)
            arguments[name] = np.ma.masked_equal([0.0, 1, 0], 1)
            with self.subTest(arguments), self.assertRaisesRegex(ValueError, f"^{name}: is a masked array"):
                palpate.press_path(**arguments)
        for name in ("depth", "speed", "hold", "lead"):
            for wrong in ([1e-3], "1", None):
                arguments = {"start": (0, 0, 0), "direction": (0, 1, 0), "depth": 1e-3, name: wrong}
                with self.subTest(arguments), self.assertRaisesRegex(ValueError, f"^{name}: give one number"):
                    palpate.press_path(**arguments)

    def test_bad_arguments_are_refused_and_change_nothing(self):
        session = palpate.Session(small_block())
        for wrong, call in [
            ("n x 3", lambda: session.run(np.zeros((4, 5)))),
            ("n x 3", lambda: session.run(np.zeros(3))),
            ("no length", lambda: session.run(np.zeros((4, 6)))),
            ("buttons", lambda: session.run(np.zeros((4, 3)), buttons=[1, 1])),
            ("fresh", lambda: session.run(np.zeros((4, 3)), fresh=[True])),
            ("poses", lambda: session.run("abc")),
            ("poses", lambda: session.run([[0, 0, 0], [1, 2]])),
            ("poses", lambda: session.advance(np.zeros((4, 3), complex))),
            ("poses: is a masked array", lambda: session.run(np.ma.zeros((4, 3)))),
            ("buttons: is a masked array", lambda: session.run(np.zeros((4, 3)), buttons=np.ma.ones(4))),
            ("pose: is a masked array", lambda: session.step(np.ma.masked_equal([0, 0, 1], 1))),
            ("pose: give", lambda: session.step(np.zeros(3, complex))),
            *(("buttons", lambda b=b: session.run(np.zeros((4, 3)), buttons=b))
              for b in (2**40, -1, 1.7, np.nan, "1", None, [1, 1, 1, 2**32], 2**70)),
            *(("buttons: give", lambda b=b: session.step(np.zeros(3), buttons=b))
              for b in (2**40, -1, 1.7, np.nan, "1", None, [1, 1], 2**70)),
            *(("fresh: give", lambda f=f: session.step(np.zeros(3), fresh=f)) for f in ("False", np.nan, 2, -1, None)),
            ("pose: give", lambda: session.step(["0", "0", "0"])),
            ("seed: give", lambda: session.perform(seed=-1)),
            *(("fresh", lambda f=f: session.run(np.zeros((4, 3)), fresh=f)) for f in ("False", np.nan, 2, None)),
            ("seconds", lambda: session.perform(seconds=np.nan)),
            ("seconds", lambda: session.perform(seconds=-1)),
            ("pose", lambda: session.step([1, 2])),
            ("pose", lambda: session.step("abc")),
        ]:
            with self.subTest(wrong), self.assertRaisesRegex(ValueError, wrong):
                call()
        self.assertEqual(session.ticks, 0)
        self.assertEqual(len(session.run(np.zeros((0, 3)))), 0)

    def test_a_step_takes_buttons_as_a_run_does(self):
        for given in (np.uint32(3), 3.0, [3], np.array(3), True):
            tick = palpate.Session(small_block()).step([0, -0.02, 0], buttons=given, fresh=np.bool_(True))
            row = palpate.Session(small_block()).run([[0, -0.02, 0]], buttons=given)[0]
            self.assertEqual((tick.buttons, tick.fresh), (row["buttons"], row["fresh"]))

    def test_names_that_are_none_are_refused_in_one_line(self):
        for wrong in ({"record": ""}, {"record": "a\0b"}, {"operator": "\udc80"}, {"operator": "a\0b"}, {"record": 3}, {"operator": 3}):
            name = next(iter(wrong))
            with self.subTest(wrong), self.assertRaisesRegex((ValueError, TypeError), f"^{name}: [^\n]*$"):
                palpate.Session(small_block(), **wrong)


class Shape(unittest.TestCase):
    def test_a_step_has_the_fields_of_a_run(self):
        poses = wander(400)
        row = palpate.Session(small_block()).run(poses)[-1]
        session = palpate.Session(small_block())
        session.advance(poses[:-1])
        tick = session.step(poses[-1])
        words = {"phase": palpate.PHASES, "warning": palpate.WARNINGS}
        for field in row.dtype.names:
            value = getattr(tick, field)
            if field in words:
                value = words[field].index(value)
            elif field in ("distance", "ahead_distance"):
                value = value[:len(row[field])]
            np.testing.assert_array_equal(value, row[field], field)

    def test_displacement_is_a_view_of_what_the_tissue_does(self):
        session = palpate.Session(small_block())
        field = session.displacement
        self.assertEqual(field.shape, (*session.model.lattice["shape"], 3))
        self.assertTrue(np.all(field == 0))
        radius = 1e-2
        session.run(palpate.press_path([0, -radius, 0], [0, 1, 0], 3e-3)[:800])
        lattice = session.model.lattice
        largest = np.unravel_index(np.argmax(np.linalg.norm(field, axis=-1)), lattice["shape"])
        place = lattice["origin"] + lattice["spacing"] * np.array(largest)
        # Under the ball, and inwards.
        self.assertLess(np.hypot(place[0], place[2]), radius)
        self.assertGreater(field[largest][1], 1e-3)
        with self.assertRaises(ValueError):
            field[0, 0, 0] = 1
        del session
        self.assertGreater(np.abs(field).max(), 1e-3)

    def test_ultrasound_shows_the_body_and_is_the_same_for_the_same_state(self):
        pictures = []
        for _ in range(2):
            session = palpate.Session(small_block())
            session.run(wander(1200))
            pictures.append(session.ultrasound(320, 320))
        np.testing.assert_array_equal(pictures[0]["pixels"], pictures[1]["pixels"])
        self.assertEqual(pictures[0]["pixels"].shape, (320, 320))
        self.assertGreater(pictures[0]["pixels"].std(), 10)
        deeper = session.ultrasound(320, 320, depth=0.03)
        self.assertAlmostEqual(deeper["depth"], 0.03, places=6)
        for wrong in ({"depth": -1}, {"face": [1e9, 0, 0]}, {"face": [np.nan, 0, 0]}, {"face": [np.inf, 0, 0]},
                      {"face": [0, 0, 0], "direction": [np.nan, 1, 0]}, {"face": [0, 0, 0], "direction": [0, 0, 0]},
                      {"face": [0, 0, 0], "direction": [0, 1, 0], "lateral": [0, 2, 0]}, {"direction": [0, 0, 0]},
                      {"lateral": [1, 0, 0]}, {"face": ["0", "0", "0"]}, {"face": np.ma.zeros(3)}):
            with self.subTest(wrong), self.assertRaises(ValueError):
                session.ultrasound(320, 320, **wrong)
        for wrong in (1e9, 1e-9):
            with self.subTest(depth=wrong), self.assertRaisesRegex(palpate.Error, "the probe has"):
                session.ultrasound(320, 320, depth=wrong)
        elsewhere = session.ultrasound(320, 320, face=[0.01, 0, 0])
        self.assertGreater(np.count_nonzero(elsewhere["pixels"] != pictures[0]["pixels"]), 1000)

    def test_a_small_picture_shows_the_body_too(self):
        session = palpate.Session(small_block())
        session.run(wander(10))
        for side in (64, 84):
            pixels = session.ultrasound(side, side)["pixels"]
            self.assertGreater(np.count_nonzero(pixels), 0.8 * side * side)
            self.assertGreater(pixels.std(), 10)

    def check_places(self, probe):
        """Pixels are the lines at the places that the documentation gives."""
        session = palpate.Session(palpate.Scene.parse(small_block().scene.text + probe))
        session.run(wander(10))
        picture = session.ultrasound(200, 260, face=[0, 0, 0])
        lines, (height, width) = picture["lines"].astype(float), picture["pixels"].shape
        samples, count = lines.shape
        column, row = np.meshgrid(np.arange(width), np.arange(height))
        lateral = (width / 2 - column - 0.5) * picture["metres_per_pixel"]
        axial = (row + 0.5) * picture["metres_per_pixel"] + picture["top"]
        angle, depth, radius = lateral, axial, picture["radius"]
        if radius > 0:
            angle, depth = np.arctan2(lateral, radius + axial), np.hypot(lateral, radius + axial) - radius
        i = angle / picture["line_pitch"] + (count - 1) / 2
        k = depth * samples / picture["depth"] - 0.5
        inside = (i > 0.01) & (i < count - 1.01) & (k > 0.01) & (k < samples - 1.01)
        self.assertGreater(np.count_nonzero(inside), 0.3 * inside.size)
        i, k = i[inside], k[inside]
        at, below, u, v = i.astype(int), k.astype(int), i % 1, k % 1
        between = (1 - v) * ((1 - u) * lines[below, at] + u * lines[below, at + 1]) \
            + v * ((1 - u) * lines[below + 1, at] + u * lines[below + 1, at + 1])
        self.assertLess(np.abs(between - picture["pixels"][inside]).max(), 5)
        self.assertLess(np.abs(between - picture["pixels"][inside]).mean(), 1)
        return session, picture

    def test_pixels_are_where_the_documentation_says(self):
        session, picture = self.check_places("")
        self.assertEqual(picture["radius"], 0)
        # The probe goes 20 columns towards its marked side: what is in the body goes to the right.
        moved = session.ultrasound(200, 260, face=[20 * picture["metres_per_pixel"], 0, 0])["pixels"]
        middle = slice(60, 140)
        there = picture["pixels"][60:200, middle].ravel()
        right, left = (np.corrcoef(there, np.roll(moved, -shift, axis=1)[60:200, middle].ravel())[0, 1] for shift in (20, -20))
        self.assertGreater(right, left + 0.2)

    def test_pixels_of_a_curved_probe_are_where_the_documentation_says(self):
        _, picture = self.check_places("""
[probe]
kind = "curved"
face_mm = [0, 0, 0]
direction = [0, 1, 0]
lateral = [1, 0, 0]
""")
        self.assertGreater(picture["radius"], 0)
        self.assertLess(picture["top"], 0)

    def test_the_first_picture_is_where_the_scene_has_the_probe(self):
        session = palpate.Session(palpate.Scene("us-core-biopsy").changed({"model.setting": "fast", "volume.voxel_mm": 2}))
        before = session.ultrasound(160, 160)
        session.step(session.model.entry - 0.02 * np.array([0, 1, 0]))
        after = session.ultrasound(160, 160)
        for key in ("face", "direction", "lateral"):
            np.testing.assert_array_equal(before[key], after[key])
        self.assertGreater(np.linalg.norm(before["face"]), 1e-3)


class Hands(InFolder):
    def test_a_scripted_hand_does_what_palpate_train_does(self):
        scene = palpate.Scene("layered").changed({"model.setting": "fast", "volume.voxel_mm": 2,
                                                  "volume.parameters.width_mm": 40})
        (self.folder / "layered.toml").write_text(scene.text)
        figure = figures("train", self.folder / "layered.toml", "--unpaced", "--seed", 1)
        session = palpate.Session(scene)
        ticks = session.perform("script")
        self.assertEqual(session.force_hash, figure["force_hash"])
        self.assertEqual(len(ticks), figure["ticks"])
        self.assertEqual(session.score()["total"], figure["score"]["total"])
        self.assertEqual(len(session.cores), len(figure["core"]))
        self.assertGreater(len(session.cores), 0)

    def test_a_hand_that_there_is_not_is_named(self):
        session = palpate.Session(palpate.Scene("block").changed({"model.level": "spring"}))
        with self.assertRaisesRegex(RuntimeError, "trainee 'fool': there are script, "):
            session.perform("fool")

    def test_a_hand_that_does_not_fit_the_tool_has_no_advice_of_the_program(self):
        session = palpate.Session(small_block())
        with self.assertRaisesRegex(palpate.Error, '"expert" takes a biopsy and the tool is no needle') as caught:
            session.perform("expert")
        self.assertNotIn("--", str(caught.exception))


if __name__ == "__main__":
    unittest.main()
