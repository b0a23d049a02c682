import pickle
import unittest

import numpy as np

import palpate
from common import InFolder, small_block


class Scenes(InFolder):
    def test_text_gives_the_scene_again(self):
        for name in palpate.scenes():
            scene = palpate.Scene(name)
            self.assertEqual(palpate.Scene.parse(scene.text).text, scene.text, name)

    def test_keywords_are_the_tables_of_a_scene_file(self):
        written = palpate.Scene(
            name="mine", volume={"phantom": "block", "voxel_mm": 3.0, "parameters": {"width_mm": 60}},
            tool={"kind": "sphere", "radius_mm": 8}, target={"structure": "tumour", "aim_mm": [0, 25, 0]},
            script=[{"kind": "move", "to_mm": [0, -20, 0], "speed_mm_s": 60, "seconds": 2}])
        told = written.to_dict()
        self.assertEqual(told["tool"]["radius_mm"], 8)
        self.assertEqual(told["volume"]["parameters"]["width_mm"], 60)
        self.assertEqual(told["script"][0]["to_mm"], [0, -20, 0])

    def test_changed_keys_change_nothing_else(self):
        before = palpate.Scene("block").to_dict()
        after = palpate.Scene("block", tool={"radius_mm": 7}).changed({"dffb.gain": 0.5}).to_dict()
        self.assertEqual(after["tool"]["radius_mm"], 7)
        self.assertEqual(after["dffb"]["gain"], 0.5)
        after["tool"]["radius_mm"], after["dffb"]["gain"] = before["tool"]["radius_mm"], before["dffb"]["gain"]
        self.assertEqual(after, before)

    def test_an_error_says_file_line_and_key(self):
        file = self.folder / "a:bad.toml"
        file.write_text('name = "x"\n[volume]\nphantom = "block"\n\n[dffb]\nrange_mm = -4\n')
        with self.assertRaises(palpate.SceneError) as caught:
            palpate.Scene(file)
        self.assertEqual(caught.exception.file, str(file))
        self.assertEqual(caught.exception.line, 6)
        self.assertEqual(caught.exception.key, "dffb.range_mm")
        self.assertIsInstance(caught.exception, ValueError)
        again = pickle.loads(pickle.dumps(caught.exception))
        self.assertEqual((again.file, again.line, again.key), (str(file), 6, "dffb.range_mm"))

    def test_errors_of_keywords_and_changes_name_the_key(self):
        with self.assertRaises(palpate.SceneError) as caught:
            palpate.Scene("block", tool={"radius_mm": -1})
        self.assertEqual(caught.exception.key, "tool.radius_mm")
        with self.assertRaises(palpate.SceneError) as caught:
            palpate.Scene(volume={"phantom": "block"}, tool={"kind": "sphere", "radius_mm": -1})
        self.assertEqual((caught.exception.file, caught.exception.line, caught.exception.key), (None, None, "tool.radius_mm"))
        self.assertNotIn("keywords", str(caught.exception))
        with self.assertRaisesRegex(palpate.SceneError, "out of range") as caught:
            palpate.Scene("block").changed({"volume.seed": 2**63})
        self.assertEqual(caught.exception.key, "volume.seed")
        with self.assertRaisesRegex(palpate.SceneError, "unknown key"):
            palpate.Scene("block", tool={"radus_mm": 1})
        with self.assertRaisesRegex(ValueError, "surrogates"):
            palpate.Model("\udce4")
        with self.assertRaisesRegex(palpate.SceneError, "built-in scenes are"):
            palpate.Scene("blok")
        with self.assertRaisesRegex(palpate.SceneError, "TOML"):
            palpate.Scene.parse("name = ")

    def test_a_tissue_that_the_volume_has_not_is_an_error_of_its_key(self):
        for call in (palpate.Model, palpate.Session, palpate.plan):
            for key, value, name in (("tissue.nope.youngs_kpa", 1, "tissue.nope"), ("tissue.fat.puncture_n", 0, "tissue.fat.cutting_n")):
                scene = palpate.Scene("block").changed({"volume.voxel_mm": 4, "model.level": "spring", key: value})
                with self.subTest(call, key=key), self.assertRaisesRegex(palpate.SceneError, r"^\[tissue\.") as caught:
                    call(scene)
                self.assertEqual((caught.exception.file, caught.exception.line, caught.exception.key), (None, None, name))
        with self.assertRaises(palpate.SceneError) as caught:
            palpate.Model(palpate.Scene.parse(palpate.Scene("block").text + "[tissue.nope]\nyoungs_kpa = 1\n", origin="mine"))
        self.assertEqual((caught.exception.file, caught.exception.key), ("mine", "tissue.nope"))

    def test_names_that_are_no_text_are_value_errors(self):
        for wrong in ("block\udc80", "block\0x"):
            with self.subTest(wrong):
                for call in (lambda: palpate.Scene(wrong), lambda: palpate.Scene(volume={"phantom": wrong}),
                             lambda: palpate.Scene("block").changed({"volume.phantom": wrong})):
                    with self.assertRaises(ValueError) as caught:
                        call()
                    self.assertNotIn("\n", str(caught.exception))
        with self.assertRaises(palpate.SceneError):
            palpate.Scene(volume={1: 2})

    def test_values_with_a_mask_and_words_are_no_numbers(self):
        masked = np.ma.array([3.0, 4.0, 5.0], mask=[False, True, False])
        for keys in ({"tissue.fat.youngs_kpa": masked[1]}, {"target.aim_mm": masked}):
            with self.subTest(keys), self.assertRaisesRegex(ValueError, "is a masked array"):
                palpate.Scene("block").changed(keys)
        for key in ("", ".", "tissue..x", "tissue.fat."):
            with self.subTest(key), self.assertRaisesRegex(RuntimeError, "has an empty part"):
                palpate.Scene("block").changed({key: 2})
        for point in (["1", "2", "3"], np.array(["1", "2", "3"]), [1j, 2, 3]):
            with self.subTest(point), self.assertRaisesRegex(ValueError, "target.aim_mm: give three numbers"):
                palpate.Scene("block").changed({"target.aim_mm": point})

    def test_lists_of_tables_are_replaced_as_a_whole(self):
        scene = palpate.Scene("breast")
        self.assertGreater(len(scene.to_dict()["vital"]), 1)
        one = palpate.Scene(scene, vital=[{"name": "artery", "warn_mm": 3}], tool={"radius_mm": 0.9})
        self.assertEqual([(v["name"], v["warn_mm"]) for v in one.to_dict()["vital"]], [("artery", 3)])
        self.assertEqual(one.to_dict()["tool"]["radius_mm"], 0.9)
        self.assertNotIn("vital", scene.changed({"vital": []}).to_dict())
        rest = one.to_dict()
        rest["vital"], rest["tool"]["radius_mm"] = scene.to_dict()["vital"], scene.to_dict()["tool"]["radius_mm"]
        self.assertEqual(rest, scene.to_dict())
        with self.assertRaisesRegex(palpate.SceneError, "name is missing"):
            scene.changed({"vital": [{"nam": "artery"}]})
        with self.assertRaisesRegex(palpate.SceneError, "at the top of a scene"):
            scene.changed({"tool.vital": [{"name": "artery"}]})


def lump_in_fat():
    """A volume in memory, 66 x 45 x 66 mm, with its skin at y = 0."""
    labels = np.zeros((44, 32, 44), np.uint16)
    labels[5:-5, 2:-2, 5:-5] = 1
    labels[19:25, 12:18, 19:25] = 2
    affine = np.diag([1.5e-3, 1.5e-3, 1.5e-3, 1.0])
    affine[:3, 3] = -33e-3, -3e-3, -33e-3
    return palpate.Volume.from_numpy(labels, affine, {1: "fat", 2: ("lump", "idc_high_grade")})


def stiffness(scene):
    """Young's modulus of fat in the scene's model [Pa]."""
    return palpate.Model(scene).volume.stiffness[22, 8, 22]


class ChangedVolumes(InFolder):
    quick = {"model.level": "spring"}

    def test_a_volume_that_is_loaded_follows_the_keys_that_change_it(self):
        volume = lump_in_fat()
        volume.save(self.folder / "v.vdb")
        file = palpate.Scene(self.folder / "v.vdb").changed(self.quick)
        scenes = {
            "file": file,
            "model": palpate.Model(file).scene,
            "open": palpate.Scene(palpate.Volume.open(self.folder / "v.vdb")).changed(self.quick),
            "memory": palpate.Scene.for_volume(lump_in_fat()).changed(self.quick),
        }
        for name, scene in scenes.items():
            with self.subTest(name):
                soft = scene.changed({"tissue.fat.youngs_kpa": 30})
                self.assertAlmostEqual(stiffness(soft), 30e3, delta=1)
                self.assertAlmostEqual(stiffness(soft.changed({"tissue.fat.youngs_kpa": 100})), 100e3, delta=1)
                self.assertAlmostEqual(stiffness(palpate.Scene(soft, tissue={"fat": {"youngs_kpa": 50}})), 50e3, delta=1)
        self.assertAlmostEqual(stiffness(palpate.Scene(str(self.folder / "v.vdb"), **{
            "tissue": {"fat": {"youngs_kpa": 40}}, "model": {"level": "spring"}})), 40e3, delta=1)

    def test_a_record_of_a_changed_file_can_be_replayed(self):
        lump_in_fat().save(self.folder / "v.vdb")
        scene = palpate.Scene(self.folder / "v.vdb").changed(self.quick).changed({"tissue.fat.youngs_kpa": 100})
        with palpate.Session(scene, record=self.folder / "r.db") as session:
            session.run(np.tile([0, -0.02, 0], (5, 1)))
        self.assertTrue(palpate.Record(self.folder / "r.db").replay()["identical"])

    def test_a_models_phantom_follows_its_parameters(self):
        coarse = palpate.Model(palpate.Scene("block").changed({"volume.voxel_mm": 4, "model.level": "spring"}))
        fine = palpate.Model(coarse.scene.changed({"volume.voxel_mm": 3}))
        np.testing.assert_allclose(fine.volume.spacing, 3e-3)

    def test_keys_that_a_volume_in_memory_cannot_follow_are_refused(self):
        scene = palpate.Scene.for_volume(lump_in_fat())
        for keys in ({"volume.file": str(self.folder / "v.vdb")}, {"tissue.nofat.youngs_kpa": 1}):
            with self.subTest(keys), self.assertRaises(palpate.SceneError):
                scene.changed(keys)

    def test_a_models_scene_gives_the_model_again_under_gravity(self):
        keys = {"volume.voxel_mm": 2, "gravity.posture": "supine", "gravity.shape": "prone", "model.level": "spring"}
        model = palpate.Model(palpate.Scene("layered").changed(keys))
        again = palpate.Model(model.scene)
        self.assertEqual(again.hash, model.hash)
        np.testing.assert_array_equal(again.aim, model.aim)

    def test_a_models_volume_is_of_the_file_that_holds_it(self):
        file = self.folder / "v.vdb"
        lump_in_fat().save(file)
        scene = palpate.Scene(file).changed(self.quick)
        self.assertEqual(palpate.Model(scene).volume.file, str(file))
        self.assertIsNone(palpate.Model(scene.changed({"tissue.fat.youngs_kpa": 9})).volume.file)
        self.assertIsNone(palpate.Model(palpate.Scene.for_volume(lump_in_fat()).changed(self.quick)).volume.file)
        self.assertIsNone(small_block().volume.file)


class Models(InFolder):
    def test_a_volume_in_memory_is_pressed_like_its_file(self):
        labels = np.zeros((44, 34, 44), np.uint16)
        labels[5:-5, 5:-5, 5:-5] = 1
        labels[19:25, 14:20, 19:25] = 2
        affine = np.diag([2e-3, 2e-3, 2e-3, 1.0])
        volume = palpate.Volume.from_numpy(labels, affine, {1: "fat", 2: ("lump", "idc_high_grade")})
        scene = palpate.Scene.for_volume(volume, "lump")
        self.assertEqual(scene.target, "lump")
        memory = palpate.Model(scene)
        with self.assertRaisesRegex(palpate.Error, "save the volume"):
            palpate.Session(memory, record=self.folder / "r.db")
        volume.save(self.folder / "v.vdb")
        file = palpate.Model(palpate.Scene.for_volume(self.folder / "v.vdb", "lump"))
        self.assertEqual(memory.hash, file.hash)
        poses = memory.entry + np.linspace(-5e-3, 5e-3, 900)[:, None] * np.array([0, 1, 0])
        ours, theirs = (palpate.Session(m).run(poses) for m in (memory, file))
        np.testing.assert_array_equal(ours["total"], theirs["total"])
        self.assertGreater(np.abs(ours["tissue_force"]).max(), 0)

    def test_a_model_says_what_it_is_of(self):
        model = small_block()
        self.assertEqual(model.structures[0], "tumour")
        self.assertIn("fat", model.tissues)
        self.assertEqual(len(model.lattice["shape"]), 3)
        self.assertEqual(model.scene.name, "block")
        made = palpate.Volume.phantom("block", voxel=3e-3, width_mm=60, thickness_mm=36, tumour_centre_mm=18,
                                      tumour_diameter_mm=14)
        np.testing.assert_array_equal(model.volume.labels, made.labels)


class OpenPoints(unittest.TestCase):
    def test_a_point_that_the_scene_leaves_open_is_set_as_a_whole(self):
        scene = palpate.Scene("layered").changed({"target.entry_mm": [1, 0, 2.5]})
        self.assertIn("entry_mm = [1.0, 0.0, 2.5]", scene.text.replace("[1, 0,", "[1.0, 0.0,"))
        whole = {"target.entry_mm.x": 1, "target.entry_mm.y": 0, "target.entry_mm.z": 2.5}
        self.assertEqual(palpate.Scene("layered").changed(whole).text, scene.text)
        array = palpate.Scene("layered").changed({"target": {"entry_mm": np.array([1, 0, 2.5])}})
        self.assertEqual(array.text, scene.text)
        for axis in "xyz":
            part = {key: value for key, value in whole.items() if not key.endswith(axis)}
            with self.subTest(axis), self.assertRaisesRegex(palpate.Error, "set its x, y and z"):
                palpate.Scene("layered").changed(part)


if __name__ == "__main__":
    unittest.main()
