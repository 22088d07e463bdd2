"""Reads PTX as far as it must to count, for each kernel: the instructions by kind, and how many registers are alive at once.

A register that is alive at some place is one that is read later and not written before. Registers count in units of 32
bits; predicates do not count. A compiler for a card may order instructions in another way, so the largest number alive is
a measure of the pressure and no promise.
"""
import collections
import re

REGISTER = re.compile(r"%[a-z]+\d+")
UNITS = {"%r": 1, "%f": 1, "%rs": 1, "%rd": 2, "%fd": 2, "%p": 0}
WRITES_NOTHING = ("st.", "bra", "ret", "bar", "red.", "membar")


class Kernel:
    def __init__(self, name):
        self.name, self.kinds, self.most_alive, self.local_bytes = name, collections.Counter(), 0, 0


def units(register):
    return UNITS[register.rstrip("0123456789")]


def operands(text):
    """The registers that an instruction writes, and those that it reads."""
    guard = re.match(r"@!?(%p\d+)\s+", text)
    reads = [guard[1]] if guard else []
    text = text[guard.end():] if guard else text
    if text.startswith(WRITES_NOTHING):
        return [], reads + REGISTER.findall(text), bool(guard)
    first, _, rest = text.partition(None or ",") if "{" not in text.split(",")[0] else text.partition("},")
    written = REGISTER.findall(first)
    return written, reads + REGISTER.findall(rest), bool(guard)


def alive(instructions):
    """The most registers that are alive before an instruction. `instructions`: texts, and labels that end with a colon."""
    labels = {text[:-1]: at for at, text in enumerate(instructions) if text.endswith(":")}
    starts = sorted({0, *labels.values(), *(at + 1 for at, text in enumerate(instructions) if re.search(r"\bbra\b|\bret\b", text))})
    starts = [at for at in starts if at < len(instructions)]
    block_of = {at: number for number, at in enumerate(starts)}
    blocks, after = [], []
    for number, at in enumerate(starts):
        end = starts[number + 1] if number + 1 < len(starts) else len(instructions)
        block = [operands(text) for text in instructions[at:end] if not text.endswith(":")]
        last = instructions[end - 1]
        follows = []
        jump = re.search(r"\bbra(?:\.uni)?\s+(\S+)", last)
        if jump:
            follows.append(block_of[labels[jump[1].rstrip(";")]])
        if not re.match(r"(bra|ret)", last) and number + 1 < len(starts):
            follows.append(number + 1)
        blocks.append(block)
        after.append(follows)
    inside = [set() for _ in blocks]
    changed = True
    while changed:
        changed = False
        for number in reversed(range(len(blocks))):
            now = set().union(*(inside[other] for other in after[number]))
            for written, read, guarded in reversed(blocks[number]):
                now = (now if guarded else now.difference(written)) | set(read)
            if now != inside[number]:
                inside[number], changed = now, True
    most = 0
    for number, block in enumerate(blocks):
        now = set().union(*(inside[other] for other in after[number]))
        size = sum(map(units, now))
        most = max(most, size)
        for written, read, guarded in reversed(block):
            for register in written:
                if not guarded and register in now:
                    now.remove(register)
                    size -= units(register)
            for register in read:
                if register not in now:
                    now.add(register)
                    size += units(register)
            most = max(most, size)
    return most


def kernels(text):
    """The kernels of a module, by name."""
    found, kernel, body = {}, None, []
    for line in text.splitlines():
        line = line.split("//")[0].strip()
        entry = re.match(r"\.visible \.entry (\w+)\(", line)
        if entry:
            kernel, body = Kernel(entry[1]), []
        elif kernel and line == "}":
            kernel.most_alive = alive(body)
            found[kernel.name] = kernel
            kernel = None
        elif kernel and line.startswith(".local"):
            kernel.local_bytes += int(re.search(r"\[(\d+)\]", line)[1])
        elif kernel and (line.endswith(";") and not line.startswith(".") or line.endswith(":")):
            body.append(line)
            if line.endswith(";"):
                kernel.kinds[re.sub(r"^@!?%p\d+\s+", "", line).split()[0].rstrip(";")] += 1
    return found
