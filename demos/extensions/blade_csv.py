"""A format of blade files of a user's own: numbers in SI units under `# x, EA, GA, GJ, EI flap, EI lag, mass`."""

from rotfem import BladeFormat, register

COLUMNS = ("EA", "GA2", "GJ", "EI2", "EI3", "mass_per_length")
HEAD = "# x, EA, GA, GJ, EI flap, EI lag, mass"


def recognises(deck):
    """Return whether a file is one of these: by its first line."""
    return deck.lines[0].strip() == HEAD


def read(deck, asked):
    """Return the keys of [structure]: the length and a table over the span for every property."""
    rows = []
    for number, line in enumerate(deck.lines[1:], start=2):
        if line.strip():
            entries = [deck.value(text, number, column) for column, text in enumerate(line.split(","), start=1)]
            if len(entries) != 1 + len(COLUMNS):
                deck.fail(f"must have {1 + len(COLUMNS)} numbers", number)
            rows.append(entries)
    section = {name: [[row[0], row[i]] for row in rows] for i, name in enumerate(COLUMNS, start=1)}
    section["GA3"] = section["GA2"]
    return {"length": rows[-1][0], "section": section}


register(BladeFormat("blade_csv", f"a table that begins with {HEAD}", recognises, read))
