"""The rooms of core, server and client as their ROOMS files list them, and the includes between files and rooms."""
import re

INCLUDE = re.compile(r'^\s*#\s*include\s+["<]((?:core|server|client)/[^">]+)[">]', re.M)
QUOTED = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.M)
CONTRACT = re.compile(r'^\s*#\s*include\s+["<]((?:varimesh|google|grpc|grpcpp)/[^">]+)[">]', re.M)
HOUSES = ("core", "server", "client")


def listed(tree, house):
    """The lines of a house's ROOMS file, lowest first: (path, what it is for)."""
    listing = tree / house / "ROOMS"
    if not listing.exists():
        return []
    lines = [line.split(maxsplit=1) for line in listing.read_text().splitlines() if line and not line.startswith("#")]
    return [(words[0], words[1] if len(words) > 1 else "") for words in lines]


def groups(tree, house):
    """The groups of a house's ROOMS file: (heading, [(path, what it is for)]). A line "## HEADING" begins a group."""
    found = []
    purposes = dict(listed(tree, house))
    for line in (tree / house / "ROOMS").read_text().splitlines():
        if line.startswith("## "):
            found.append((line.removeprefix("## "), []))
        elif line and not line.startswith("#"):
            found[-1][1].append((line.split()[0], purposes[line.split()[0]]))
    return found


def room_of(path, rooms):
    """The room that a file is in. If several lines fit, it is the longest, so that a file comes before its folder.

    A line that ends with a slash is a folder; one that ends with a dot is a header and its source; others are one file.
    """
    fitting = [room for room in rooms if path == room or (room.endswith(("/", ".")) and path.startswith(room))]
    return max(fitting, key=len, default=None)


def includes(tree):
    """For each source file, the files of core, server and client that it includes."""
    found = {}
    for house in HOUSES:
        for source in sorted((tree / house).rglob("*")):
            if source.suffix in (".h", ".cpp"):
                file = source.relative_to(tree).as_posix()
                # Highway compiles a file once per instruction set by including it again. That is no circle.
                found[file] = [target for target in INCLUDE.findall(source.read_text()) if target != file]
    return found
