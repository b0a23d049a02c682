import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Path = str | os.PathLike[str]

DEADMAN: int
FIRE: int
MARK: int
UNMARK: int
EVENTS: tuple[str, ...]
PHASES: tuple[str, ...]
WARNINGS: tuple[str, ...]
TICK_SECONDS: float
build: str

class Volume:
    """A body as a label map with tissues. Immutable."""

    @staticmethod
    def open(file: _Path) -> Volume:
        """Reads a .vdb that palpate wrote. Raises palpate.Error; ValueError for an empty name."""
    @staticmethod
    def import_(
        path: _Path,
        *,
        set: Mapping[int | str, str] = {},
        map: str = "",
        default_tissue: str = "",
        image: _Path = "",
        image_unit: str = "",
        image_series: str = "",
        ignore_frame_of_reference: bool = False,
        stiffness_from: str = "",
        voxel: float = 0.0,
        body_from_image: bool = False,
        body_from_hull: float = 0.0,
        tissues: _Path = "",
    ) -> Volume:
        """What `palpate import` makes of a segmentation: NIfTI, NRRD, MetaImage, DICOM, OpenVDB, a folder of masks.

        Args:
            path: file or folder.
            set: {label's name or value: tissue}; values as int or str.
            map: a built-in label map's name, or a TOML file.
            default_tissue: of labels that nothing else names.
            image: CT or MR of the same patient, on any grid.
            image_unit: "HU" where the image's file does not say so.
            image_series: SeriesInstanceUID where the image is a folder with several; "": that which the DICOM SEG names.
            ignore_frame_of_reference: accept an image whose DICOM frame of reference is not that of the labels.
            stiffness_from: "hu" or a TOML file: the image scales Young's modulus.
            voxel: edge of new, cubic voxels [m]; 0: as they are.
            body_from_image: find the body around the labels in the image, which is CT.
            body_from_hull: thickness of a body that is invented around them [m].
            tissues: tissue table (.toml) in place of the built-in one.

        Raises:
            palpate.Error: "FILE: what is wrong and what to do"; labels without a tissue are listed.
        """
    @staticmethod
    def phantom(name: str = "breast", seed: int = 1, voxel: float = 1e-3, tissues: _Path = "", **parameters: float | str) -> Volume:
        """A phantom: same arguments, same volume, bit for bit.

        Args:
            name: one of palpate.phantoms().
            seed: of every random choice.
            voxel: edge of a voxel [m].
            tissues: tissue table (.toml) in place of the built-in one.
            parameters: of the phantom, in the units of their names: tumour_diameter_mm=12. docs/scenes.md lists them.

        Raises:
            palpate.Error: unknown name or parameter, or a value out of its range.
        """
    @staticmethod
    def from_numpy(
        labels: ArrayLike,
        affine: ArrayLike,
        tissues: Mapping[int, str | tuple[str, str]],
        *,
        image: ArrayLike | None = None,
        image_unit: str = "",
        frame: Literal["LPS", "RAS"] = "LPS",
        table: _Path = "",
    ) -> Volume:
        """A volume of an array of labels. The array is copied.

        Args:
            labels: whole numbers, 0 to 65535, (i, j, k); 0 without a tissue is outside. No tool enters the body within 3 voxels
                of the array's border, where it may be cut: leave 4 voxels of 0 around it (numpy.pad, and move the origin).
            affine: 4 x 4, voxel index to patient [m]. nibabel's is in mm: multiply its first three rows by 1e-3. Axes are at right
                angles, voxels of 1 um to 10 m, and all places within 10 m of the origin.
            tissues: {value: tissue} or {value: (structure's name, tissue)} for every value that is there.
            image: intensities on the same voxels.
            image_unit: "HU" or "".
            frame: of the affine: LPS (DICOM, ITK) or RAS (NIfTI, 3D Slicer).
            table: tissue table (.toml) in place of the built-in one.

        Raises:
            ValueError: shapes, types, the affine or the frame are not right; every label is 0, and 0 has no tissue; an array has
                a mask, or is not of numbers; a structure's name is empty, holds a control character or is there twice.
            palpate.Error: a value without a tissue, a tissue that the table does not have.
        """
    def save(self, file: _Path) -> None:
        """Writes a .vdb, and no other name, whole, or leaves what was there. Raises palpate.Error; ValueError for an
        empty name."""
    @property
    def labels(self) -> NDArray[np.uint16]:
        """(i, j, k), read-only. The dense array is made once, when first asked for; further views share it and keep it alive,
        also those of Model.volume."""
    @property
    def stiffness(self) -> NDArray[np.float32]:
        """Young's modulus [Pa], (i, j, k), read-only, as labels; 0 outside."""
    @property
    def image(self) -> NDArray[np.float32] | None:
        """The image on the same voxels, read-only, as labels; None where the volume came without one."""
    @property
    def image_unit(self) -> str: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def affine(self) -> NDArray[np.float64]:
        """4 x 4, voxel index to patient (LPS) [m]."""
    @property
    def spacing(self) -> NDArray[np.float64]:
        """Edges of a voxel (3) [m]."""
    @property
    def info(self) -> dict[str, Any]:
        """What `palpate info --json` says: size, spacing_mm, labels with their voxels and volumes, warnings."""
    @property
    def provenance(self) -> dict[str, list[str]]: ...
    @property
    def tissues(self) -> list[dict[str, Any]]:
        """Rows of the tissue table: name, role, youngs_modulus [Pa], poisson_ratio, density [kg/m^3], puncture_force [N], fixed, source."""
    @property
    def file(self) -> str | None:
        """That it was read from or saved to, absolute; None: it is in memory alone."""

class Scene:
    """What a session is of: volume, tool, tissue model, target. docs/scenes.md has all keys."""

    def __init__(self, source: Scene | Volume | _Path | None = None, **tables: Any) -> None:
        """A scene by name, file or volume (.vdb), with keys changed; or, without `source`, of keywords alone, the tables of a
        scene file: Scene(name="mine", volume={"phantom": "block"}, tool={"kind": "sphere", "radius_mm": 8}, ...).

        Raises:
            palpate.SceneError: with file, line and key.
        """
    @staticmethod
    def parse(text: str, origin: str = "text") -> Scene:
        """A scene of TOML text; `origin` stands for the file in errors. Raises palpate.SceneError."""
    @staticmethod
    def for_volume(volume: Volume | _Path, target: str = "") -> Scene:
        """The standard biopsy of a volume's first tumour, or of the structure `target`. Raises palpate.Error."""
    def changed(self, keys: Mapping[str, Any]) -> Scene:
        """The scene with keys set, written with dots or nested: {"tissue.fat.youngs_kpa": 10, "tool": {"radius_mm": 7}}. Where they
        change the volume, it is read or made again. One in memory alone follows keys of tissues, and no others. A list of
        dictionaries replaces all of vital, insert or script: {"vital": [{"name": "artery"}]}.
        Raises palpate.SceneError; ValueError for a point that is none and for masked values."""
    def to_dict(self) -> dict[str, Any]: ...
    @property
    def name(self) -> str: ...
    @property
    def text(self) -> str:
        """The whole scene as TOML."""
    @property
    def origin(self) -> str: ...
    @property
    def target(self) -> str: ...

class Model:
    """Everything of a session that does not change: fields, lattice, planned line. Sessions and threads share it."""

    def __init__(self, scene: Scene | Volume | Model | _Path) -> None:
        """Builds it: tenths of a second to seconds. Other threads go on. Raises palpate.SceneError, palpate.Error."""
    @property
    def scene(self) -> Scene: ...
    @property
    def volume(self) -> Volume:
        """In the scene's posture. Its `file` is None where the file holds another body: before gravity, inserts or keys of tissues."""
    @property
    def structures(self) -> list[str]:
        """Target first, then the vital structures: the columns of `distance`."""
    @property
    def tissues(self) -> list[str]: ...
    @property
    def entry(self) -> NDArray[np.float64]:
        """Where the planned line enters the body (3) [m]."""
    @property
    def aim(self) -> NDArray[np.float64]:
        """Where it ends (3) [m]."""
    @property
    def firing_depth(self) -> float:
        """How deep the tip goes by hand along the planned line, so that the fired notch is at the aim [m]."""
    @property
    def lattice(self) -> dict[str, Any]:
        """shape (3), origin (3) [m] and spacing [m] of the nodes of Session.displacement."""
    @property
    def rate(self) -> float:
        """Of the ticks [Hz]: 1000, or that of the record that the model came from."""
    @property
    def hash(self) -> str: ...

class Tick:
    """What one tick computed, in SI units; the fields of Session.run()."""

    @property
    def tick(self) -> int: ...
    @property
    def position(self) -> NDArray[np.float64]: ...
    @property
    def axis(self) -> NDArray[np.float64]: ...
    @property
    def buttons(self) -> int: ...
    @property
    def fresh(self) -> bool: ...
    @property
    def proxy(self) -> NDArray[np.float64]: ...
    @property
    def tissue_force(self) -> NDArray[np.float64]: ...
    @property
    def basic(self) -> NDArray[np.float64]: ...
    @property
    def additional(self) -> NDArray[np.float64]: ...
    @property
    def total(self) -> NDArray[np.float64]: ...
    @property
    def energy(self) -> float: ...
    @property
    def damped(self) -> float: ...
    @property
    def deflection(self) -> NDArray[np.float64]: ...
    @property
    def phase(self) -> str: ...
    @property
    def warning(self) -> str: ...
    @property
    def tissue(self) -> int: ...
    @property
    def inserted(self) -> float: ...
    @property
    def contacts(self) -> int: ...
    @property
    def penetration(self) -> float: ...
    @property
    def moved(self) -> int: ...
    @property
    def residual(self) -> float: ...
    @property
    def ahead(self) -> float: ...
    @property
    def ahead_tissue(self) -> int: ...
    @property
    def ahead_speed(self) -> float: ...
    @property
    def distance_to_target(self) -> float: ...
    @property
    def nearest_vital(self) -> int: ...
    @property
    def warned(self) -> int: ...
    @property
    def probe_move(self) -> NDArray[np.float64]: ...
    @property
    def probe_face(self) -> NDArray[np.float64]: ...
    @property
    def probe_axis(self) -> NDArray[np.float64]: ...
    @property
    def probe_lateral(self) -> NDArray[np.float64]: ...
    @property
    def probe_force(self) -> NDArray[np.float64]: ...
    @property
    def distance(self) -> NDArray[np.float64]:
        """16 numbers, of which those of the model's structures count [m]."""
    @property
    def ahead_distance(self) -> NDArray[np.float64]:
        """As `distance`, along the needle's line to where it would touch each; infinite where it meets none [m]."""
    @property
    def events(self) -> int: ...
    @property
    def fired(self) -> bool: ...
    @property
    def faulted(self) -> bool: ...
    @property
    def needle_in_beam(self) -> float: ...
    @property
    def tip_in_beam(self) -> bool: ...

class Session:
    """One session: poses in, ticks out. From any thread, one at a time; a `with` block closes it."""

    def __init__(self, scene: Scene | Volume | Model | _Path, record: _Path | None = None, operator: str = "") -> None:
        """
        Args:
            scene: or a Model, which several sessions may share.
            record: file for a record, which must not be there yet; close() ends it.
            operator: who holds the tool, or a pseudonym, for the record.

        Raises:
            palpate.SceneError, palpate.Error. ValueError, TypeError: record or operator is no name.
        """
    def step(self, pose: ArrayLike, buttons: ArrayLike = DEADMAN, fresh: ArrayLike = True) -> Tick:
        """One tick: a millisecond, unless Model.rate is another.

        Args:
            pose: (x, y, z) of the tool's tip, or a sphere's centre [m]; or with the tool's axis behind it (6). Without an
                axis the last one stays; the first is that of the planned line. With 12 numbers the last six are how far the hand has
                moved the scene's ultrasound probe: press, slide, sweep [m], rock, tilt, turn [rad].
            buttons: DEADMAN (held: forces are sent), FIRE, MARK, UNMARK (takes the last mark back), added up.
            fresh: False says that the device had no new pose.

        Raises:
            ValueError: the pose has not so many numbers, or buttons or fresh as run() refuses them. Numbers that are no pose
                (NaN, beyond 10 m) raise nothing: they switch the force off, as a broken device would, and event "fault"
                says so. palpate.Error: the session is closed, or at work in another thread.
        """
    def run(self, poses: ArrayLike, buttons: ArrayLike = DEADMAN, fresh: ArrayLike = True) -> NDArray[np.void]:
        """A tick for each pose; the GIL is released. The same poses give the same bits as step() and `palpate replay`.

        Args:
            poses: n x 3, n x 6 [m], or n x 12 as step().
            buttons, fresh: one value, or n; whole numbers below 2**32, and True or False.

        Returns:
            structured array of n; docs/python.md lists the fields.

        Raises:
            ValueError: shapes or values are not right; nothing was done. palpate.Error: as step().
            KeyboardInterrupt: after a whole tick; `interrupted` has the rows so far and the session may go on.
        """
    def advance(self, poses: ArrayLike, buttons: ArrayLike = DEADMAN, fresh: ArrayLike = True) -> int:
        """run() without the rows. Returns how many ticks."""
    def perform(self, trainee: str = "script", seed: int = 1, seconds: float = 120.0) -> NDArray[np.void]:
        """A simulated hand does the scene's task: "script", or a trainee ("novice", "resident", "expert"), as `palpate train`.

        Args:
            seconds: at most; 0: until the hand is done.

        Returns:
            rows as run(). Raises palpate.Error where tool, task and trainee do not go together or Model.rate is not 1000,
            ValueError for seconds below 0 and for a seed below 0.
        """
    def close(self) -> None:
        """Ends the record. Raises palpate.Error when it is not whole (a full disk) or not there (removed or moved)."""
    def __enter__(self) -> Session: ...
    def __exit__(self, *_: object) -> None: ...
    def score(self) -> dict[str, Any]:
        """Of the ticks so far, by the keys of docs/score.md."""
    def ultrasound(
        self,
        width: int = 640,
        height: int = 640,
        *,
        face: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        lateral: ArrayLike | None = None,
        depth: float = 0.0,
    ) -> dict[str, Any]:
        """The B-mode picture of the deformed body.

        Args:
            width, height: pixels, 16 to 8192.
            face: middle of the probe's face (3) [m]; None: where the scene has the probe, else as the viewer places it.
            direction, lateral: into the body, and along the face (3 each), with `face` alone; None: (0, 1, 0) and (1, 0, 0).
            depth: of the picture [m], what the probe has; 0: its own.

        Returns:
            dict: pixels (height x width, uint8), lines (samples x lines, uint8, before scan conversion), metres_per_pixel,
            top [m], line_pitch [m, curved probe: rad], radius [m, 0 for a linear probe], depth [m], frequency [Hz], face,
            direction, lateral, tick.

            The probe's marked side is at the left: columns run against `lateral`. The middle of pixel (row, column) is at
            face + a * lateral + b * direction with

                a = (width / 2 - column - 0.5) * metres_per_pixel
                b = (row + 0.5) * metres_per_pixel + top

            Lines run along `lateral`, from the right border of the picture to the left: sample k of line i has the depth
            z = (k + 0.5) * depth / samples, and with l = (i - (lines - 1) / 2) * line_pitch it is at a = l, b = z, of a
            curved probe at a = (radius + z) * sin(l), b = (radius + z) * cos(l) - radius.

        Raises:
            ValueError: no point or direction, or a direction without `face` or length, both along each other, a depth below 0. palpate.Error: the size, a depth that
                the probe does not have.
        """
    @property
    def events(self) -> NDArray[np.void]:
        """Structured array: tick, kind (EVENTS names it), structure (-1: none), tissue, value (SI, by kind)."""
    @property
    def cores(self) -> list[dict[str, Any]]:
        """What the gun took: fraction {tissue: share}, volume [m^3], target_fraction, target_length [m], fragments, notch_start, notch_end."""
    @property
    def displacement(self) -> NDArray[np.float32]:
        """Of the lattice's nodes (nx, ny, nz, 3) [m]: a read-only view that follows the session; copy it to keep a moment."""
    @property
    def interrupted(self) -> NDArray[np.void] | None:
        """Rows of the last run() or perform(), where an exception (Ctrl-C) ended it; else None. advance() has none."""
    @property
    def model(self) -> Model: ...
    @property
    def ticks(self) -> int: ...
    @property
    def closed(self) -> bool: ...
    @property
    def force_hash(self) -> str:
        """Of every bit of every force so far; `palpate replay` prints the same."""

class RecordFile:
    def __init__(self, file: _Path) -> None: ...
    @property
    def file(self) -> str: ...
    @property
    def info(self) -> dict[str, Any]: ...
    @property
    def scene_text(self) -> str: ...
    @property
    def complete(self) -> bool: ...
    @property
    def results(self) -> dict[str, str]: ...
    def read_ticks(self) -> tuple[NDArray[np.void], NDArray[np.void]]: ...
    def replay(self) -> dict[str, Any]: ...
    def score(self) -> dict[str, Any]: ...
    def model(self) -> Model: ...

def plan(
    scene: Scene | Volume | _Path,
    *,
    error: float = 0.03,
    force_error: float | None = None,
    budget: float = 4e-4,
    speed: float = 0.02,
    costs: _Path | None = None,
) -> dict[str, Any]:
    """The cheapest tissue model that holds an error of the shape (share) and a time per tick [s]: figures of `palpate plan`.

    Args:
        force_error: of the force, too (share); only level "elastic" can hold it.
        speed: of the test push, 0.001 to 1 [m/s].
        costs: what `palpate bench costs --json` wrote on the machine that is to run the model; None: the built-in costs of one
            server core.

    Returns:
        found, and where True level, spacing_mm, windows, sweeps, predicted_error_pct, predicted_us; candidates.

    Raises:
        ValueError: an error, budget or speed that is none. palpate.SceneError. palpate.Error: costs that are none, a budget
            that is too small for any model.
    """

def phantoms() -> list[str]: ...
def scenes() -> list[str]: ...
def run_sweep(folder: _Path, plan: str, jobs: int, retry: bool, any_build: bool, told: Callable[[int, int], bool]) -> int: ...
def sweep_outputs() -> dict[str, dict[str, str]]: ...
def merge_shards(folder: _Path, shards: Sequence[_Path], any_build: bool) -> None: ...
