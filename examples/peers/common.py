"""Reads the CSV files in data/, and sets the style of the pictures."""

import csv
import pathlib

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402

HERE = pathlib.Path(__file__).parent
# Okabe and Ito's palette, which is safe for colour-blind readers.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
plt.rcParams.update(
    {
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "axes.grid": True,
        "grid.color": "#e4e4e4",
        "axes.prop_cycle": matplotlib.cycler(color=COLOURS),
        "svg.hashsalt": "splitsnow",
        "legend.frameon": False,
    }
)


def table(name):
    """The columns of data/NAME.csv as lists, and a dictionary of the numbers in its lines
    `# key number`."""
    numbers, rows = {}, []
    with open(HERE / "data" / f"{name}.csv") as file:
        for line in file:
            if line.startswith("#"):
                words = line[1:].replace(":", " ").split()
                try:
                    numbers[words[0]] = float(words[-1])
                except ValueError:
                    pass
            else:
                rows.append(line)
    columns = {}
    for row in csv.DictReader(rows):
        for key, value in row.items():
            columns.setdefault(key, []).append(float(value or "nan"))
    return columns, numbers


def save(figure, name, out):
    """Writes the picture as SVG and PNG."""
    out = pathlib.Path(out)
    out.mkdir(parents=True, exist_ok=True)
    figure.tight_layout()
    figure.savefig(out / f"{name}.svg", metadata={"Date": None})
    figure.savefig(out / f"{name}.png", dpi=96)


def write(name, out, columns):
    """Writes columns, by name, as NAME.csv."""
    with open(pathlib.Path(out) / f"{name}.csv", "w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(columns)
        for row in zip(*columns.values()):
            rows.writerow([f"{value:.6g}" for value in row])
