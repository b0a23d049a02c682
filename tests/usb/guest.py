"""A virtual machine with Palpate inside and an emulated Falcon on its USB."""
import json
import os
import pathlib
import queue
import re
import shutil
import subprocess
import tempfile
import threading
import time

MODULES = ["xhci-pci", "ftdi_sio"]
APPLETS = "sh mount insmod poweroff echo cat ls sleep kill stty rm test mkdir dmesg".split()
INIT = """#!/bin/sh
mount -t proc p /proc; mount -t sysfs s /sys; mount -t devtmpfs d /dev
mkdir /dev/shm; mount -t tmpfs t /dev/shm; mount -t tmpfs t /tmp
%s
exec </dev/ttyS0 >/dev/ttyS0 2>&1
stty -echo
echo '<<ready>>'
while read -r line; do eval "$line"; echo "<<$?>>"; done
poweroff -f
"""


def modules_in_order(folder):
    """The .ko files of MODULES and what they need, what is needed first."""
    files = {f.stem.replace("-", "_"): f for f in folder.rglob("*.ko")}
    order = []

    def add(name):
        name = name.replace("-", "_")
        if name not in files or files[name] in order:
            return
        needs = subprocess.run(["modinfo", "-F", "depends", files[name]], capture_output=True, text=True, check=True).stdout
        for need in filter(None, needs.strip().split(",")):
            add(need)
        order.append(files[name])

    for name in MODULES:
        add(name)
    return order


def initramfs(root, kernel, program, files):
    """Fills the folder `root` and packs it; returns the archive."""
    for folder in ("bin", "proc", "sys", "dev", "tmp", "lib/m"):
        (root / folder).mkdir(parents=True)
    shutil.copy(shutil.which("busybox"), root / "bin/busybox")
    for applet in APPLETS:
        (root / "bin" / applet).symlink_to("busybox")
    insmod = []
    for module in modules_in_order(kernel / "modules"):
        shutil.copy(module, root / "lib/m")
        insmod.append(f"insmod /lib/m/{module.name}")
    subprocess.run(["strip", "-o", root / "bin/palpate", program], check=True)
    (root / "bin/palpate").chmod(0o755)
    for library in set(re.findall(r"/[^ ]+", subprocess.run(["ldd", program], capture_output=True, text=True).stdout)):
        target = root / library.lstrip("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(library, target)
    for name, data in files.items():
        (root / name).write_bytes(data)
    (root / "init").write_text(INIT % "\n".join(insmod))
    (root / "init").chmod(0o755)
    archive = root.with_suffix(".cpio")
    with open(archive, "wb") as out:
        names = subprocess.run(["find", "."], cwd=root, capture_output=True, check=True).stdout
        subprocess.run(["cpio", "-o", "-H", "newc", "--quiet"], cwd=root, input=names, stdout=out, check=True)
    return archive


class Lines:
    """What a program prints, line by line, without ever blocking it."""

    def __init__(self, stream):
        self.queue = queue.Queue()
        self.all = []
        threading.Thread(target=self._read, args=(stream,), daemon=True).start()

    def _read(self, stream):
        for line in stream:
            line = line.rstrip("\r\n")
            self.all.append(line)
            self.queue.put(line)
        self.queue.put(None)

    def next(self, seconds):
        try:
            line = self.queue.get(timeout=max(seconds, 0.01))
        except queue.Empty:
            raise RuntimeError("it says no more; its last lines were:\n" + "\n".join(self.all[-20:])) from None
        if line is None:
            raise RuntimeError("it ended; its last lines were:\n" + "\n".join(self.all[-20:]))
        return line


class Falcon:
    """The emulated one, and the hand at its grip."""

    def __init__(self, program, socket, firmware):
        self.process = subprocess.Popen([program, "--socket", socket, "--firmware", firmware], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True, bufsize=1)
        self.lines = Lines(self.process.stdout)

    def order(self, text):
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()
        return json.loads(self.lines.next(10))

    def state(self):
        return self.order("state")

    def until(self, what, seconds, holds):
        """The first state in which `holds`."""
        end = time.monotonic() + seconds
        while True:
            state = self.state()
            if holds(state):
                return state
            if time.monotonic() > end:
                raise AssertionError(f"not within {seconds} s: {what}; the Falcon: {state}")
            time.sleep(0.01)


class Guest:
    def __init__(self, folder, kernel, program, emulator, files):
        folder = pathlib.Path(folder)
        archive = initramfs(folder / "root", pathlib.Path(kernel), program, files)
        socket, firmware = folder / "usb", folder / "root/firmware.bin"
        self.qemu = subprocess.Popen(
            ["qemu-system-x86_64", "-M", "pc", "-accel", "tcg", "-cpu", "max", "-m", "1024", "-smp", "2", "-nodefaults",
             "-no-user-config", "-display", "none", "-serial", "stdio", "-no-reboot", "-kernel", kernel / "vmlinux", "-initrd",
             archive, "-append", "console=ttyS0 quiet panic=-1 tsc=reliable no_timer_check", "-device", "qemu-xhci,id=xhci",
             "-chardev", f"socket,id=usb,path={socket},server=on,wait=off", "-device", "usb-redir,chardev=usb,bus=xhci.0"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1, errors="replace")
        self.lines = Lines(self.qemu.stdout)
        self.falcon = Falcon(emulator, socket, firmware)
        try:
            self._until("<<ready>>", 120)
        except BaseException:
            self.close()
            raise

    def _until(self, mark, seconds):
        end = time.monotonic() + seconds
        text = []
        while True:
            line = self.lines.next(end - time.monotonic())
            found = re.search(mark, line)
            if found:
                return found, text
            text.append(line)

    def run(self, command, seconds=60):
        """Exit status and output of a shell command in the guest."""
        self.qemu.stdin.write(command + "\n")
        self.qemu.stdin.flush()
        found, text = self._until(r"<<(\d+)>>", seconds)
        return int(found.group(1)), "\n".join(text)

    def close(self):
        self.qemu.kill()
        self.falcon.process.kill()
        self.qemu.wait()
        self.falcon.process.wait()
