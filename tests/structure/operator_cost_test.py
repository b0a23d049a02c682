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


def cheapest_turn(body):
    """(additions, multiplications) of the cheapest way around a loop over cells with tissue: that of whole cells whose tissue does
    not stiffen. Cells without tissue take under a hundred additions."""
    lines = [m.groups() for line in body if (m := re.match(r"\s*([0-9a-f]+):\s+(\S+)\s*([0-9a-f]*)", line))]
    place = {int(at, 16): i for i, (at, _, _) in enumerate(lines)}
    blocks = {}  # first line -> (additions, multiplications, first lines of what may follow)
    heads = set()
    leads = {0}
    for i, (_, name, to) in enumerate(lines):
        if name[0] == "j":
            leads.add(i + 1)
            if to and int(to, 16) in place:
                leads.add(place[int(to, 16)])
                if place[int(to, 16)] <= i:
                    heads.add(place[int(to, 16)])
    for start in leads - {len(lines)}:
        end = min((i for i in leads if i > start), default=len(lines))
        _, name, to = lines[end - 1]
        follows = [] if name in ("jmp", "ret") else [end]
        if name[0] == "j" and to and int(to, 16) in place:
            follows.append(place[int(to, 16)])
        counts = (sum(1 for _, n, _ in lines[start:end] if kind.search(n)) for kind in (ADDITION, MULTIPLICATION))
        blocks[start] = (*counts, [f for f in follows if f < len(lines)])
    turns = []

    def go(head, at, seen, additions, multiplications):
        more, times, follows = blocks[at]
        for to in follows:
            if to == head:
                turns.append((additions + more, multiplications + times))
            elif to not in seen:
                go(head, to, seen | {to}, additions + more, multiplications + times)

    for head in heads:
        go(head, head, {head}, 0, 0)
    return min((t for t in turns if t[0] > 100), key=sum, default=(0, 0))


def main(library, source):
    said = re.search(r"OperatorCost\{(\d+), (\d+), bytes\} : OperatorCost\{(\d+), (\d+), bytes\}", Path(source).read_text())
    expected = {"NeoHookean": (int(said[1]), int(said[2])), "Linear": (int(said[3]), int(said[4]))}
    seen = {law: 0 for law in expected}
    for name, body in functions(library):
        # Those of windows without thin layers.
        law = next((law for law in expected if re.search(rf"strip<.*\b{law}\b.*NoLayers", name)), None)
        # The plain operator: those that end in a pass have that besides, and relieved bending has its factors.
        plain = "Keep, " in name and "Relieved" not in name
        if law is None or not plain or not any("zmm" in line for line in body):
            continue
        seen[law] += 1
        counted = cheapest_turn(body)
        for what, is_, should in zip(("additions", "multiplications"), counted, expected[law]):
            if abs(is_ - should) > 0.03 * should:
                sys.exit(f"{law}: {is_} {what} in the compiled loop, {should} in {source}")
    missing = [law for law, n in seen.items() if n == 0]
    if missing:
        sys.exit(f"{library}: no loop over cells of {', '.join(missing)} found")
    print(f"{seen} loops counted")


if __name__ == "__main__":
    main(*sys.argv[1:])
