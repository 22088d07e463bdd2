"""Lines of a table that a benchmark keeps in a file, one JSON object each, so that it can go on where it was stopped."""
import hashlib
import json
import sys


class KeptLines:
    """The lines of a file that one program has made.

    A line is found by the values of some of its fields. Lines of another program are not mixed with those of this one: if the
    file has some, this ends with exit status 2 and a sentence.
    """

    def __init__(self, path, program, fields):
        """`path`: the file, or None to keep nothing. `program`: the command that is measured. `fields`: names."""
        self.path, self.fields, self.known = path, fields, {}
        if path is None:
            return
        self.digest = hashlib.sha256(program.read_bytes()).hexdigest()[:16]
        for line in map(json.loads, path.read_text().splitlines()) if path.exists() else ():
            if line.get("program") != self.digest:
                print(f"{path} has lines of another program than {program}; move it away, or keep the lines in another file.",
                      file=sys.stderr)
                sys.exit(2)
            self.known[tuple(line[field] for field in fields)] = line

    def get(self, *values):
        return self.known.get(values)

    def add(self, line):
        """Keeps the line and returns it."""
        if self.path is not None:
            with self.path.open("a") as file:
                file.write(json.dumps(line | {"program": self.digest}) + "\n")
        return line
