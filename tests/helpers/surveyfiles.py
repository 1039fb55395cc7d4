"""Survey tables cut and written as CSV."""

HEADER = [
    "LINE",
    "FLIGHT",
    "UTC",
    "LON",
    "LAT",
    "EASTING",
    "NORTHING",
    "GPSZ",
    "FZ",
    "AZ",
    "GRVRAW",
    "LATCOR",
    "EOTCOR",
    "FACOR",
    "FRA100",
    "FRAL100",
    "GND_FA",
]


def cut(table, rows):
    return {name: values[rows] for name, values in table.items()}


def write_csv(path, table, header=HEADER, opener=open):
    with opener(path, "wt") as stream:
        stream.write(",".join(header) + "\n")
        for row in zip(*(table[name] for name in header), strict=True):
            stream.write(",".join(f"{v:.7f}" for v in row) + "\n")
