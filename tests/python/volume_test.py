import gc
import os
import tempfile
import unittest

import numpy as np

import palpate
from common import InFolder, figures, program


def cube(size=12):
    labels = np.zeros((size, size + 1, size + 2), np.uint16)
    labels[2:-2, 2:-2, 2:-2] = 1
    labels[4:7, 5:8, 5:8] = 2
    return labels


TISSUES = {1: "fat", 2: ("lump", "idc_high_grade")}
AFFINE = np.diag([1e-3, 2e-3, 3e-3, 1.0])


def placed(affine, origin):
    out = affine.copy()
    out[:3, 3] = origin
    return out


def sheared(affine):
    out = affine.copy()
    out[0, 1] = 1e-3
    return out


class FromNumpy(InFolder):
    def test_labels_come_back_as_they_were(self):
        labels = cube()
        volume = palpate.Volume.from_numpy(labels, AFFINE, TISSUES)
        np.testing.assert_array_equal(volume.labels, labels)
        np.testing.assert_array_equal(volume.affine, AFFINE)
        self.assertEqual(volume.shape, labels.shape)

    def test_any_order_and_type_of_numbers_gives_the_same_labels(self):
        labels = cube()
        for given in (labels.tolist(), labels.astype(np.int64), np.asfortranarray(labels), labels[::-1][::-1], labels.astype(">u2")):
            np.testing.assert_array_equal(palpate.Volume.from_numpy(given, AFFINE, TISSUES).labels, labels)

    def test_the_program_counts_the_same_voxels(self):
        labels = cube()
        palpate.Volume.from_numpy(labels, AFFINE, TISSUES).save(self.folder / "v.vdb")
        told = figures("info", self.folder / "v.vdb")
        counted = {one["value"]: one["voxels"] for one in told["labels"]}
        self.assertEqual(counted, dict(zip(*(n.tolist() for n in np.unique(labels, return_counts=True)))))
        self.assertEqual(told["spacing_mm"], [1, 2, 3])

    def test_ras_differs_in_the_signs_of_x_and_y(self):
        lps = palpate.Volume.from_numpy(cube(), AFFINE, TISSUES).affine
        ras = palpate.Volume.from_numpy(cube(), AFFINE, TISSUES, frame="RAS").affine
        np.testing.assert_array_equal(ras, np.diag([-1, -1, 1, 1]) @ lps)

    def test_an_image_comes_back(self):
        labels = cube()
        image = np.random.default_rng(1).normal(size=labels.shape).astype(np.float32)
        volume = palpate.Volume.from_numpy(labels, AFFINE, TISSUES, image=image, image_unit="HU")
        np.testing.assert_array_equal(volume.image, image)
        self.assertEqual(volume.image_unit, "HU")
        for unit in ("hu", "Hounsfield", " HU"):
            with self.assertRaisesRegex(ValueError, "image_unit"):
                palpate.Volume.from_numpy(labels, AFFINE, TISSUES, image=image, image_unit=unit)
        for value in (np.nan, np.inf, 1e300):
            broken = image.astype(float)
            broken[0, 0, 0] = value
            with self.assertRaisesRegex(ValueError, "not finite"):
                palpate.Volume.from_numpy(labels, AFFINE, TISSUES, image=broken)
        self.assertIsNone(palpate.Volume.from_numpy(labels, AFFINE, TISSUES).image)

    def test_bad_arguments_are_refused_by_what_is_wrong(self):
        for wrong, labels, affine, tissues in [
            ("whole numbers", cube().astype(float), AFFINE, TISSUES),
            ("three dimensions", cube()[0], AFFINE, TISSUES),
            ("0 to 65535", cube().astype(int) - 1, AFFINE, TISSUES),
            ("0 to 65535", cube().astype(np.uint64) + np.uint64(2**63), AFFINE, TISSUES),
            ("keys are label values", cube(), AFFINE, {"1": "fat", 2: "fat"}),
            ("keys are label values", cube(), AFFINE, {1: "fat", 70000: "fat"}),
            ("label 1: give a tissue", cube(), AFFINE, {1: None, 2: "fat"}),
            ("label 1: give a tissue", cube(), AFFINE, {1: ("a", "fat", "c"), 2: "fat"}),
            ("without a mask", np.ma.masked_array(cube(), mask=cube() == 1), AFFINE, TISSUES),
            ("labels: give an array", [[[1]], [[1, 2]]], AFFINE, TISSUES),
            ("affine: give 4 x 4", cube(), "abc", TISSUES),
            ("4 x 4", cube(), np.eye(3), TISSUES),
            ("0 0 0 1", cube(), np.vstack([AFFINE[:3], [[0, 0, 1, 1]]]), TISSUES),
            ("not finite", cube(), placed(AFFINE, [np.nan] * 3), TISSUES),
            ("not finite", cube(), placed(AFFINE, [0, np.inf, 0]), TISSUES),
            ("not finite", cube(), np.diag([1e200, 2e-3, 3e-3, 1]), TISSUES),
            ("no patient", cube(), np.diag([1e19, 2e-3, 3e-3, 1]), TISSUES),
            ("no patient", cube(), np.diag([1e-9, 2e-3, 3e-3, 1]), TISSUES),
            ("reaches 18[0-9.]* m .* 10 m is the most", cube(), placed(AFFINE, [18, 0, 0]), TISSUES),
            ("right angles", cube(), sheared(AFFINE), TISSUES),
            ("no volume", cube(), np.diag([0, 0, 0, 1]), TISSUES),
            ("label 2", cube(), AFFINE, {1: "fat"}),
            ("^tissues: label 1: its name is empty$", cube(), AFFINE, {1: ("", "fat"), 2: "fat"}),
            ("^tissues: label 1: its name is empty$", cube(), AFFINE, {1: (" ", "fat"), 2: "fat"}),
            *(("^tissues: label 1: its name holds a control character$", cube(), AFFINE, {1: (f"a{wrong}b", "fat"), 2: "fat"})
              for wrong in "\0\n\x1f\x7f\x80\x9f"),
            ("^tissues: labels 1 and 2 are both called 'x'", cube(), AFFINE, {1: ("x", "fat"), 2: ("x", "fat")}),
            ("^tissues: labels 1 and 2 are both called 'fat'", cube(), AFFINE, {1: ("fat", "skin"), 2: "fat"}),
            ("no tissue 'cheese'", cube(), AFFINE, {1: "fat", 2: "cheese"}),
        ]:
            with self.subTest(wrong), self.assertRaisesRegex((ValueError, palpate.Error), wrong):
                palpate.Volume.from_numpy(labels, affine, tissues)

    def test_names_may_be_of_any_script_and_labels_may_share_their_tissue(self):
        volume = palpate.Volume.from_numpy(cube(), AFFINE, {1: ("Ä ö\u00a0乳", "fat"), 2: ("À", "fat")})
        self.assertEqual([one["name"] for one in volume.info["labels"] if one["tissue"] == "fat"], ["Ä ö\u00a0乳", "À"])
        palpate.Volume.from_numpy(cube(), AFFINE, {1: "fat", 2: "fat"})

    def test_what_is_wrong_with_a_volume_in_memory_names_no_file(self):
        for labels, tissues, wrong in ((cube(), {1: "air", 2: "air"}, "^has no labels of tissue"),
                                       (cube(), {1: ("a", "fat"), 2: ("b", "fat")}, "^no tumour or lesion to aim at: choose .* one of a, b$")):
            volume = palpate.Volume.from_numpy(labels, AFFINE, tissues)
            with self.subTest(wrong), self.assertRaisesRegex(palpate.Error, wrong):
                palpate.Scene.for_volume(volume)
            with self.subTest(wrong), self.assertRaisesRegex(palpate.Error, wrong):
                palpate.Model(volume)

    def test_images_and_affines_of_what_is_no_number_are_refused(self):
        image = np.zeros(cube().shape)
        for given in (image.astype(complex), image.astype(str), np.full(image.shape, np.datetime64("2026-01-01"))):
            with self.subTest(given.dtype), self.assertRaisesRegex(ValueError, "image: give an array of numbers, not of"):
                palpate.Volume.from_numpy(cube(), AFFINE, TISSUES, image=given)
        for given in (AFFINE.astype(complex), AFFINE.astype(str)):
            with self.subTest(given.dtype), self.assertRaisesRegex(ValueError, "affine: give 4 x 4 numbers"):
                palpate.Volume.from_numpy(cube(), given, TISSUES)
        same = palpate.Volume.from_numpy(cube(), AFFINE.astype(object), TISSUES, image=image.astype(object))
        np.testing.assert_array_equal(same.affine, AFFINE)

    def test_an_affine_that_is_none_is_a_value_error(self):
        for origin in ([np.nan] * 3, [18, 0, 0]):
            with self.subTest(origin), self.assertRaises(ValueError):
                palpate.Volume.from_numpy(cube(), placed(AFFINE, origin), TISSUES)

    def test_a_unit_without_an_image_is_refused(self):
        with self.assertRaisesRegex(ValueError, "image_unit: needs the image"):
            palpate.Volume.from_numpy(cube(), AFFINE, TISSUES, image_unit="HU")

    def test_arguments_of_an_image_need_one(self):
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "a.vdb")
            for more in ({"image_series": "1.2"}, {"ignore_frame_of_reference": True}):
                with self.subTest(more), self.assertRaisesRegex(palpate.Error, f"^{next(iter(more))}: needs the image: give image="):
                    palpate.Volume.import_(file, **more)

    def test_a_phantoms_parameter_without_a_number_is_named(self):
        with self.assertRaisesRegex(TypeError, "width_mm: give a number or a word, not None"):
            palpate.Volume.phantom("block", width_mm=None)
        with self.assertRaisesRegex(palpate.Error, "width_mm: must be a number"):
            palpate.Volume.phantom("block", width_mm="abc")
        self.assertEqual(palpate.Volume.phantom("block", voxel=4e-3, width_mm=np.float32(60)).shape,
                         palpate.Volume.phantom("block", voxel=4e-3, width_mm=60).shape)


class Views(unittest.TestCase):
    def test_stiffness_is_that_of_the_tissue_table(self):
        volume = palpate.Volume.from_numpy(cube(), AFFINE, TISSUES)
        modulus = {row["name"]: row["youngs_modulus"] for row in volume.tissues}
        expected = np.choose(cube(), [0, modulus["fat"], modulus["idc_high_grade"]])
        np.testing.assert_allclose(volume.stiffness, expected, rtol=1e-6)

    def test_views_are_of_one_memory_and_cannot_be_written(self):
        volume = palpate.Volume.phantom("block", voxel=4e-3)
        self.assertTrue(np.shares_memory(volume.labels, volume.labels))
        self.assertFalse(volume.labels.flags.owndata)
        for view in (volume.labels, volume.stiffness):
            with self.assertRaises(ValueError):
                view[0, 0, 0] = 1

    def test_a_view_outlives_its_volume(self):
        kept = palpate.Volume.phantom("block", voxel=4e-3).labels[3:]
        before = kept.copy()
        gc.collect()
        others = [palpate.Volume.phantom("block", seed=s, voxel=4e-3).labels for s in range(4)]
        np.testing.assert_array_equal(kept, before)
        self.assertEqual(len(others), 4)


class Files(InFolder):
    def test_a_file_stays_where_it_is_when_the_working_directory_changes(self):
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(self.folder)
        volume = palpate.Volume.from_numpy(cube(), AFFINE, TISSUES)
        volume.save("v.vdb")
        opened = palpate.Volume.open("v.vdb")
        os.chdir(before)
        for one in (volume, opened):
            self.assertEqual(one.file, str(self.folder / "v.vdb"))
            self.assertEqual(palpate.Scene.for_volume(one).to_dict()["volume"]["file"], str(self.folder / "v.vdb"))

    def test_a_volume_is_saved_under_the_name_of_a_volume_alone(self):
        volume = palpate.Volume.from_numpy(cube(), AFFINE, TISSUES)
        for name in ("lump", "lump.nii", "lump.vdb.gz"):
            with self.subTest(name), self.assertRaisesRegex(palpate.Error, f"{name}: a volume is a .vdb file"):
                volume.save(self.folder / name)
        self.assertEqual(list(self.folder.iterdir()), [])
        self.assertIsNone(volume.file)

    def test_a_phantom_is_that_of_the_program(self):
        program("phantom", "layered", "--voxel", "3", "-o", self.folder / "p.vdb")
        theirs = palpate.Volume.open(self.folder / "p.vdb")
        ours = palpate.Volume.phantom("layered", voxel=3e-3)
        np.testing.assert_array_equal(ours.labels, theirs.labels)

    def test_an_import_is_that_of_the_program(self):
        palpate.Volume.from_numpy(cube(), AFFINE, TISSUES).save(self.folder / "v.vdb")
        program("export", self.folder / "v.vdb", "-o", self.folder / "v.nii.gz")
        program("import", self.folder / "v.nii.gz", "--set", "1=fat", "--set", "2=liver", "-o", self.folder / "w.vdb")
        theirs = palpate.Volume.open(self.folder / "w.vdb")
        ours = palpate.Volume.import_(self.folder / "v.nii.gz", set={"1": "fat", "2": "liver"})
        np.testing.assert_array_equal(ours.labels, theirs.labels)
        self.assertEqual(ours.info["labels"], theirs.info["labels"])
        np.testing.assert_allclose(ours.affine, AFFINE, atol=1e-9)

    def test_what_is_added_beside_tissue_of_label_0_is_air(self):
        labels = np.zeros((20, 20, 20), np.uint8)
        labels[8:12, 8:12, 8:12] = 3
        palpate.Volume.from_numpy(labels, AFFINE, {0: "fat", 3: "idc_high_grade"}).save(self.folder / "v.vdb")
        program("export", self.folder / "v.vdb", "-o", self.folder / "v.nrrd")
        program("import", self.folder / "v.nrrd", "--set", "0=fat", "--set", "3=idc_high_grade", "--pad", "6",
                "-o", self.folder / "w.vdb")
        padded = palpate.Volume.open(self.folder / "w.vdb")
        self.assertEqual(padded.shape, (32, 26, 24))
        inside = (slice(6, -6), slice(3, -3), slice(2, -2))
        self.assertEqual(np.count_nonzero(padded.labels), labels.size)
        np.testing.assert_array_equal(padded.labels[inside] == 3, labels == 3)
        self.assertTrue((padded.labels[inside] != 0).all())
        hull = palpate.Volume.import_(self.folder / "v.nrrd", body_from_hull=5e-3, set={"0": "fat", "3": "idc_high_grade"})
        self.assertIn("invented_skin", [one["name"] for one in hull.info["labels"]])
        self.assertEqual(hull.labels[0, 0, 0], 0)

    def test_labels_may_be_named_by_their_numbers(self):
        palpate.Volume.from_numpy(cube(), AFFINE, TISSUES).save(self.folder / "v.vdb")
        program("export", self.folder / "v.vdb", "-o", self.folder / "v.nii.gz")
        words = palpate.Volume.import_(self.folder / "v.nii.gz", set={"1": "fat", "2": "liver"})
        numbers = palpate.Volume.import_(self.folder / "v.nii.gz", set={1: "fat", np.uint16(2): "liver"})
        self.assertEqual(numbers.info["labels"], words.info["labels"])
        with self.assertRaisesRegex(TypeError, "set: label 1: give a word"):
            palpate.Volume.import_(self.folder / "v.nii.gz", set={1: None})

    def test_advice_is_of_python(self):
        palpate.Volume.from_numpy(cube(), AFFINE, {1: "fat", 2: ("x7", "fat")}).save(self.folder / "v.vdb")
        program("export", self.folder / "v.vdb", "-o", self.folder / "v.nrrd")
        file = self.folder / "v.nrrd"
        for says, call in [
            ("give map=NAME .*, set={NAME: TISSUE} or default_tissue=NAME", lambda: palpate.Volume.import_(file)),
            ("^voxel -1000mm: must be a length", lambda: palpate.Volume.import_(file, voxel=-1)),
            ("^body_from_hull -1000mm: must be", lambda: palpate.Volume.import_(file, body_from_hull=-1)),
            ("^body_from_image: needs the image: give image=FILE$", lambda: palpate.Volume.import_(file, body_from_image=True)),
            ("^set 9=fat: no voxel", lambda: palpate.Volume.import_(file, set={9: "fat"}, default_tissue="fat")),
            ("target=NAME", lambda: palpate.Scene(palpate.Volume.from_numpy(cube(), AFFINE, {1: "fat", 2: "fat"}))),
        ]:
            with self.subTest(says), self.assertRaisesRegex(palpate.Error, says) as caught:
                call()
            self.assertNotIn("--", str(caught.exception).replace(str(file), ""))

    def test_names_of_files_that_are_no_utf_8_stay_as_they_are(self):
        file = self.folder / "v\udce4.vdb"
        with self.assertRaisesRegex(palpate.Error, "v\udce4.vdb: "):
            palpate.Volume.open(file)
        volume = palpate.Volume.from_numpy(cube(), AFFINE, TISSUES)
        volume.save(file)
        self.assertEqual(volume.file, str(file))
        self.assertEqual(palpate.Volume.open(volume.file).file, str(file))

    def test_a_seed_that_is_none_is_named(self):
        for seed, error in ((-1, ValueError), (2**64, ValueError), (1.5, TypeError), ("1", TypeError)):
            with self.subTest(seed), self.assertRaisesRegex(error, "^seed: give a whole number[^\n]*$"):
                palpate.Volume.phantom("block", seed=seed)

    def test_too_little_air_around_a_body_is_said(self):
        labels = np.ones((24, 24, 24), np.uint8)
        labels[9:15, 9:15, 9:15] = 2
        volume = palpate.Volume.from_numpy(labels, np.diag([2e-3] * 3 + [1]), {1: "fat", 2: ("lump", "idc_high_grade")})
        with self.assertRaisesRegex(palpate.Error, "border.*add 4 voxels of air"):
            palpate.Model(palpate.Scene.for_volume(volume).changed({"model.level": "spring"}))
        padded = palpate.Volume.from_numpy(np.pad(labels, 3), volume.affine, {1: "fat", 2: ("lump", "idc_high_grade")})
        palpate.Model(palpate.Scene.for_volume(padded).changed({"model.level": "spring"}))

    def test_lengths_out_of_bounds_are_refused(self):
        for wrong in ({"voxel": 1.0}, {"voxel": -1e-3}, {"voxel": np.nan}, {"body_from_hull": -5.0},
                      {"body_from_hull": np.nan}, {"body_from_hull": 1e-4}):
            with self.subTest(wrong), self.assertRaisesRegex(palpate.Error, "must be a length from"):
                palpate.Volume.import_(self.folder / "none.nii", **wrong)

    def test_labels_where_no_pose_is_are_refused(self):
        file = self.folder / "far.nrrd"
        header = ("NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 4 4 4\nencoding: raw\n"
                  "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: ({},0,0)\n\n")
        for origin, wrong in ((20, None), (20000, "far.nrrd: a label map reaches 20.0035 m")):
            file.write_bytes(header.format(origin).encode() + bytes([1] * 64))
            if wrong is None:
                palpate.Volume.import_(file, set={"1": "fat"})
            else:
                with self.assertRaisesRegex(palpate.Error, wrong):
                    palpate.Volume.import_(file, set={"1": "fat"})

    def test_a_damaged_description_is_said_in_plain_text(self):
        file = self.folder / "v.vdb"
        palpate.Volume.from_numpy(cube(), AFFINE, TISSUES).save(file)
        whole = file.read_bytes()
        self.assertIn(b'"format":', whole)
        file.write_bytes(whole.replace(b'"format":', b'"form\xff\xfe":'))
        with self.assertRaisesRegex(palpate.Error, "v.vdb: is damaged"):
            palpate.Volume.open(file)

    def test_errors_name_the_file(self):
        with self.assertRaisesRegex(palpate.Error, "nothing.vdb"):
            palpate.Volume.open(self.folder / "nothing.vdb")
        (self.folder / "text.nii").write_text("no volume")
        with self.assertRaisesRegex(palpate.Error, "text.nii"):
            palpate.Volume.import_(self.folder / "text.nii")


if __name__ == "__main__":
    unittest.main()
