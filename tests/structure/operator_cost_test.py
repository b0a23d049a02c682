"""What studies/kernel/bench_operator.cpp says an operator asks for is what the compiled loops over cells have."""
import re
import subprocess
import sys
from pathlib import Path

ADDITION = re.compile(r"\bv?(add|sub)ps\b")
MULTIPLICATION = re.compile(r"\bv?mulps\b")


def functions(library):
    """(name, lines) of each function of a library."""
    text = subprocess.run(["objdump", "-d", "-C", "--no-show-raw-insn", library], check=True, capture_output=True, text=True).stdout
    name, body = None, []
    for line in text.splitlines():
        start = re.match(r"[0-9a-f]+ <(.*)>:$", line)
        if start:
            if name:
                yield name, body
            name, body = start[1], []
        elif "\t" in line:
            body.append(line)
    if name:
        yield name, body


def largest_loop(body):
    """(additions, multiplications) between a jump back and where it leads, where these are most."""
    place = {int(m[1], 16): i for i, line in enumerate(body) if (m := re.match(r"\s*([0-9a-f]+):", line))}
    most = (0, 0)
    for i, line in enumerate(body):
        # A jump that is always taken comes back from cells that are cut, which are not counted.
        jump = re.search(r"\bj(?!mp)\w+\s+([0-9a-f]+)\b", line)
        target = place.get(int(jump[1], 16), i) if jump else i
        if target < i:
            loop = body[target : i + 1]
            most = max(most, tuple(sum(1 for x in loop if kind.search(x)) for kind in (ADDITION, MULTIPLICATION)))
    return most


def main(library, source):
    said = re.search(r"OperatorCost\{(\d+), (\d+), bytes\} : OperatorCost\{(\d+), (\d+), bytes\}", Path(source).read_text())
    expected = {"NeoHookean": (int(said[1]), int(said[2])), "Linear": (int(said[3]), int(said[4]))}
    seen = {law: 0 for law in expected}
    for name, body in functions(library):
        # Those of windows without thin layers.
        law = next((law for law in expected if re.search(rf"layer<.*\b{law}\b.*NoLayers", name)), None)
        # The plain operator: those that end in a pass have that besides, and relieved bending has its factors.
        plain = "Keep>" in name and "Relieved" not in name
        if law is None or "layer<" not in name or not plain or not any("zmm" in line for line in body):
            continue
        seen[law] += 1
        counted = largest_loop(body)
        for what, is_, should in zip(("additions", "multiplications"), counted, expected[law]):
            if abs(is_ - should) > 0.03 * should:
                sys.exit(f"{law}: {is_} {what} in the compiled loop, {should} in {source}")
    missing = [law for law, n in seen.items() if n == 0]
    if missing:
        sys.exit(f"{library}: no loop over cells of {', '.join(missing)} found")
    print(f"{seen} loops counted")


if __name__ == "__main__":
    main(*sys.argv[1:])
