"""From the command line to the hand: a Linux kernel with its USB, libusb, Palpate; and an emulated Falcon on the wire.

    guest_test.py PALPATE EMULATOR KERNEL      exit status 0: all held
"""
import json
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from guest import Guest

SCENE = b"""name = "block"
[volume]
phantom = "block"
voxel_mm = 4.0
[model]
level = "spring"
spacing_mm = 10
[tool]
kind = "sphere"
radius_mm = 10
[dffb]
mode = "off"
[target]
entry_mm = [0, 0, 0]
structure = "tumour"
aim_mm = [0, 25, 0]
"""
FIRMWARE = random.Random(1).randbytes(3000)
CENTRE, LEFT = 4, 8  # buttons: the dead-man switch, the end of the session
RED, GREEN, BLUE = 2, 4, 8
PARK, PRESSED = "hand 0 0 165 60", "hand 0 0 128 40"  # mm: 30 mm outside the body, and 7 mm more than up to it
TRAIN = "palpate train /scene.toml --device falcon --falcon-firmware /firmware.bin --no-view"


def check(what, holds, seen=""):
    print(("ok      " if holds else "FAILED  ") + what + (f": {seen}" if seen != "" else ""), flush=True)
    if not holds:
        raise AssertionError(what)


def off(state):
    return state["motor"] == [0, 0, 0]


def pushes(newton):
    return lambda s: s["force_n"][2] > newton


def wakes(guest):
    """Moves the grip about, as the user is asked to, until the session has begun; then holds it where it is to start."""
    falcon = guest.falcon
    end = time.monotonic() + 60
    falcon.order("buttons 0")
    side = 5
    while falcon.state()["lamps"] != BLUE:
        assert time.monotonic() < end, f"the Falcon does not become ready: {falcon.state()}"
        side = -side
        falcon.order(f"hand {side} {side} {160 + side} 60")
        time.sleep(0.3)
    falcon.order(PARK)
    # Its weight is carried from the first tick on.
    falcon.until("the session begins", 60, lambda s: s["force_n"][1] > 0.5)


def presses(guest, newton):
    guest.falcon.order(f"buttons {CENTRE}")
    guest.falcon.order(PRESSED)
    return guest.falcon.until(f"a force of {newton} N", 40, pushes(newton))


def starts(guest, options=""):
    guest.run(f"rm -f /tmp/*; ({TRAIN} {options} >/tmp/out 2>&1; echo $? >/tmp/status) &")
    wakes(guest)


def ended(guest, seconds=30):
    """Exit status of the session, and what it printed."""
    end = time.monotonic() + seconds
    while guest.run("test -s /tmp/status")[0] != 0:
        assert time.monotonic() < end, "it does not end; it said: " + guest.run("cat /tmp/out")[1]
        time.sleep(0.1)
    return int(guest.run("cat /tmp/status")[1]), guest.run("cat /tmp/out")[1]


def kill(guest, signal, program="palpate"):
    guest.run(f"kill -{signal} $(cat /proc/[0-9]*/stat | sed -n 's/^\\([0-9]*\\) ({program}) .*/\\1/p')")


def devices(guest):
    end = time.monotonic() + 20
    while not (figures := json.loads(guest.run("palpate devices --json -")[1]))["falcons"] and time.monotonic() < end:
        time.sleep(0.1)  # the kernel is still getting to know it
    check("one Falcon is there, allowed, without firmware",
          len(figures["falcons"]) == 1 and figures["falcons"][0]["allowed"] and not figures["falcons"][0]["firmware_runs"])
    status, said = guest.run("palpate devices --exchanges 1")
    check("without a firmware file it says what to give", status == 1 and "--falcon-firmware" in said)
    guest.run("echo 0403 cb48 >/sys/bus/usb-serial/drivers/ftdi_sio/new_id; sleep 0.5")
    figures = json.loads(guest.run("palpate devices --json -")[1])
    check("the kernel's serial driver has bound it", figures["falcons"][0]["kernel_driver"] == "ftdi_sio")
    start = guest.falcon.state()["packets"]
    status, said = guest.run("palpate devices --falcon-firmware /firmware.bin --exchanges 10000 --json /tmp/figures; echo; "
                             "test -s /tmp/figures", 90)
    exchanges = json.loads(guest.run("cat /tmp/figures")[1])["exchanges"]
    state = guest.falcon.state()
    check("it was loaded, homed, and answered 10,000 packets", exchanges["answered"] >= 10000 and exchanges["firmware_loaded"]
          and state["homed"] and state["packets"] - start >= 10000,
          f"{exchanges['rate_hz']:.0f}/s, p50 {exchanges['round_trip_us']['p50']:.0f} us")
    check("and is left without torque", off(state))
    guest.run("echo 0403 cb48 >/sys/bus/usb-serial/drivers/ftdi_sio/remove_id")


def session(guest):
    """Touch, press, let go; unplugged in contact and plugged in again; ended by the button."""
    falcon = guest.falcon
    starts(guest, "--on-unplug wait --json /tmp/figures")
    state = presses(guest, 0.7)
    check("touch and press: the hand feels the tissue", state["lamps"] == GREEN, f"{state['force_n'][2]:.2f} N")
    time.sleep(1.5)
    falcon.order(PARK)
    state = falcon.until("the tissue lets go", 20, lambda s: abs(s["force_n"][2]) < 0.02)
    felt = state["peak_push_n"]

    presses(guest, 0.7)
    falcon.order("unplug")
    time.sleep(1.0)
    check("unplugged in contact: it says so and waits",
          "the Falcon was unplugged: the force is off" in guest.run("cat /tmp/out")[1])
    falcon.order("plug")
    falcon.until("plugged in again: the torque is off at once", 20, off)
    wakes(guest)
    state = presses(guest, 0.7)
    check("and the session goes on", True, f"{state['force_n'][2]:.2f} N")
    falcon.order(PARK)
    falcon.until("the tissue lets go", 20, lambda s: abs(s["force_n"][2]) < 0.02)
    falcon.order(f"buttons {LEFT}")
    status, said = ended(guest)
    check("the left button ends it in good order", status == 0, said if status else "")
    falcon.until("no torque is left", 5, off)
    falcon.order("buttons 0")
    sent = json.loads(guest.run("cat /tmp/figures")[1])["peak_force_n"]["total"]
    felt = max(felt, falcon.state()["peak_push_n"])
    check("what the emulated arm felt is what was sent", abs(felt - sent) < 0.05 + 0.02 * sent, f"{felt:.3f} N of {sent:.3f} N")


def signals(guest):
    """Whatever ends the program or stops it, no torque is left."""
    falcon = guest.falcon
    starts(guest)
    presses(guest, 0.7)
    kill(guest, "STOP")
    falcon.until("stopped (Ctrl-Z): the torque is off", 10, off)
    kill(guest, "CONT")
    state = presses(guest, 0.7)
    check("a stopped program leaves no torque, and goes on by itself", True, f"{state['force_n'][2]:.2f} N")
    kill(guest, "KILL", "palpate-guard")
    kill(guest, "SEGV")
    falcon.until("after a crash the torque is off", 10, off)
    status, _ = ended(guest)
    check("a crash leaves no torque, by the signal handler alone", status > 128, status)

    starts(guest)
    presses(guest, 0.7)
    kill(guest, "KILL")
    falcon.until("killed: the torque is off", 10, off)
    check("nor does SIGKILL, by the guardian", ended(guest)[0] == 137)


def unplugged(guest):
    starts(guest)
    presses(guest, 0.7)
    guest.falcon.order("unplug")
    status, said = ended(guest)
    check("unplugged, by default it ends with a message", status == 1 and "the Falcon was unplugged" in said,
          next((line for line in said.splitlines() if "unplugged" in line), ""))


def main():
    palpate, emulator, kernel = (pathlib.Path(a).resolve() for a in sys.argv[1:4])
    if not shutil.which("qemu-system-x86_64") or not emulator.exists():
        print("qemu-system-x86 or the emulator is not here: run scripts/install-packages --test and build again")
        return 1
    unpacked = subprocess.run([pathlib.Path(__file__).parent / "guest-kernel", kernel], check=False).returncode
    if unpacked != 0:
        # Words of tests/skips.cmake: ctest takes them for a skip.
        print("Skipped\nthere is no kernel for the virtual machine and none could be downloaded")
        return 1
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        guest = Guest(folder, kernel, palpate, emulator, {"firmware.bin": FIRMWARE, "scene.toml": SCENE})
        try:
            print(f"the virtual machine is up after {time.monotonic() - start:.1f} s")
            for part in (devices, session, signals, unplugged):
                part(guest)
                print(f"{time.monotonic() - start:.1f} s", flush=True)
        except Exception:
            print("the session said: " + guest.run("cat /tmp/out")[1])
            raise
        finally:
            guest.close()
    return 0


sys.exit(main())
