"""What an attacker makes of a good file, picture or command line; each from a seed, so that it can be made again."""

from __future__ import annotations

import re
import struct
import zlib
from random import Random

WORDS = (
    *("[]", "{}", "~", "null", "true", "nothing", "0", "-1", "-0.0", "1", "1e-300", "1e8", "1e308", "-1e308", "1e400"),
    *(".nan", "NaN", ".inf", "-Infinity", "99999999999999", "9" * 400, "0x10", "1_000", "1,5", "٣", "½", "[1, [2, 3]]"),
    *("{rows: 1}", '""', "''", "None", "b'x'", "(", ")", "'", '"', "<a>", "</a>", "<!DOCTYPE a>", "&lol;", "#"),
    *("%YAML:1.0", "!!python/object:os.system", "*a", "&a [*a]", "../../etc/passwd", "\x1b[31mred\x1b[0m", "\x07"),
    *("\u202egpj", "\u2028", "\0", "\t", "\n", "\r\n", "---", "...", "a" * 5000, "[" * 200, "{a: " * 200, "é", "𝕏"),
)
NUMBERS = (0.0, -1.0, 1e-300, 1e-12, 1e-6, 1e-3, 0.5, 2.0, -2.0, 10.0, 1e3, 1e5, 1e6, 1e9, 1e15, 1e100, 1e300)
ENCODINGS = ("utf-16", "utf-32", "utf-8-sig", "latin-1", "cp1252", "cp037")
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")


def mutated(rng: Random, content: bytes, other: bytes) -> bytes:
    """One to three changes of a file; `other` is another one, of which a piece may come in."""
    for _ in range(rng.choice((1, 1, 1, 1, 2, 3))):
        change = rng.choice(BINARY if b"\0" in content[:4096] else TEXT)
        content = change(rng, content, other)[: 2**21]
    return content


def cut(rng: Random, content: bytes, _: bytes) -> bytes:
    return content[: rng.randint(0, len(content))]


def without_head(rng: Random, content: bytes, _: bytes) -> bytes:
    return content[rng.randint(0, len(content)) :]


def overwritten(rng: Random, content: bytes, _: bytes) -> bytes:
    changed = bytearray(content or b" ")
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(changed) + 1)
        changed[at : at + rng.randint(0, 4)] = rng.randbytes(rng.randint(0, 4))
    return bytes(changed)


def bit_flipped(rng: Random, content: bytes, _: bytes) -> bytes:
    changed = bytearray(content or b" ")
    for _ in range(rng.randint(1, 16)):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def spliced(rng: Random, content: bytes, other: bytes) -> bytes:
    at, start = rng.randint(0, len(content)), rng.randint(0, len(other))
    return content[:at] + other[start : start + rng.randint(0, 2000)] + content[at:]


def repeated(rng: Random, content: bytes, _: bytes) -> bytes:
    start = rng.randint(0, len(content))
    piece = content[start : start + rng.randint(1, 400)]
    return content[:start] + piece * rng.choice((2, 10, 1000)) + content[start:]


def doubles_changed(rng: Random, content: bytes, _: bytes) -> bytes:
    """Eight bytes become a number of 64 bits: what binary formats hold."""
    changed = bytearray(content.ljust(8, b"\0"))
    value = rng.choice((*NUMBERS, float("nan"), float("inf")))
    at = rng.randrange(0, len(changed) - 7, rng.choice((1, 4, 8)))
    changed[at : at + 8] = struct.pack(rng.choice("<>") + "d", value)
    return bytes(changed)


def integers_changed(rng: Random, content: bytes, _: bytes) -> bytes:
    changed = bytearray(content.ljust(8, b"\0"))
    at = rng.randrange(len(changed) - 3)
    value = rng.choice((0, 1, 2, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1))
    changed[at : at + 4] = struct.pack(rng.choice("<>") + "I", value)
    return bytes(changed)


def other_number(rng: Random, content: bytes, _: bytes) -> bytes:
    """One number, or all with the same digits, is scaled or replaced; the file stays what it is."""
    text = content.decode("utf-8", "surrogateescape")
    found = list(NUMBER.finditer(text))
    if not found:
        return content
    at = rng.choice(found)
    factor = rng.choice(NUMBERS)
    value = float(at[0]) * factor if rng.random() < 0.6 else factor
    word = str(int(value)) if rng.random() < 0.3 and abs(value) < 1e18 else repr(value)
    return (text[: at.start()] + word + text[at.end() :]).encode("utf-8", "surrogateescape")


def other_word(rng: Random, content: bytes, _: bytes) -> bytes:
    """One word becomes something else, is said twice, or is missing."""
    text = content.decode("utf-8", "surrogateescape")
    found = list(re.finditer(r"[-+.\w]+|[^-+.\w\s]", text))
    if not found:
        return content
    at = rng.choice(found)
    word = rng.choice((*WORDS, "", f"{at[0]} {at[0]}", f"{at[0]}{at[0]}"))
    return (text[: at.start()] + word + text[at.end() :]).encode("utf-8", "surrogateescape")


def other_lines(rng: Random, content: bytes, _: bytes) -> bytes:
    """A line is missing, is said twice, or changes places with another."""
    lines = content.splitlines(keepends=True)
    if len(lines) < 2:
        return content
    one, two = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(3):
        case 0:
            del lines[one]
        case 1:
            lines.insert(two, lines[one])
        case _:
            lines[one], lines[two] = lines[two], lines[one]
    return b"".join(lines)


def recoded(rng: Random, content: bytes, _: bytes) -> bytes:
    text = content.decode("utf-8", "replace")
    return text.encode(rng.choice(ENCODINGS), "replace")


def nested(rng: Random, content: bytes, _: bytes) -> bytes:
    deep = rng.choice((2, 31, 100, 30_000))
    left, right = rng.choice((("[", "]"), ('{"a":', "}"), ("<a>", "</a>"), ("- " * 2, "")))
    return left.encode() * deep + content + right.encode() * deep


ANY = (cut, without_head, overwritten, bit_flipped, spliced, repeated)
TEXT = (*ANY, other_word, other_word, other_lines, recoded, nested) + (other_number,) * 24
"""Numbers most often: a file stays readable, and what comes after reading is attacked by it."""
BINARY = (*ANY, integers_changed, doubles_changed, doubles_changed)


# Pictures -------------------------------------------------------------------------------------------------------------


def mutated_picture(rng: Random, content: bytes, other: bytes) -> bytes:
    """A picture file, damaged; for PNG at times with checksums that are right again, so that its decoder is reached."""
    if rng.random() < 0.03:
        return bomb(rng)
    changed = mutated(rng, content, other)
    return with_checksums(changed) if changed.startswith(b"\x89PNG") and rng.random() < 0.5 else changed


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def with_checksums(png: bytes) -> bytes:
    """A PNG file whose chunks have the checksums that belong to what they hold now."""
    made, at = png[:8], 8
    while at + 12 <= len(png):
        length = struct.unpack_from(">I", png, at)[0]
        made += chunk(png[at + 4 : at + 8], png[at + 8 : at + 8 + length])
        at += 12 + length
    return made


def bomb(rng: Random) -> bytes:
    """A small PNG file that unfolds to many pixels, or announces more than there are."""
    side = rng.choice((1, 15, 16, 17, 3_000, 9_000, 30_000, 2**20, 2**31 - 1))
    tall = rng.choice((1, 17, side))
    rows = b"\0" * ((side // 8 + 2) * tall) if side * tall < 3e8 else b"\0" * 10_000
    header = struct.pack(">IIBBBBB", side, tall, rng.choice((1, 8, 16)), rng.choice((0, 2, 6)), 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b"")


# Command lines --------------------------------------------------------------------------------------------------------

VALUES = (
    *("", " ", "-", "--", "---", "-1", "0", "1", "2x2", "3x3", "9x6", "200x200", "1e308", "nan", "inf", "-inf"),
    *(
        "9" * 400,
        "9x6x2",
        "x",
        "½",
        "٣x٣",
        "\x1b[31m",
        "a\nb",
        "\0",
        "\udce9",
        "'",
        '"',
        "$(id)",
        "%s",
        "{}",
        "../..",
        ".",
    ),
    *("/dev/null", "/dev/full", "/", "~", "a" * 300, "a/" * 3000, "nowhere", "nowhere.png", "*.png", "[", "**/*"),
    *("k1,k2,k3", "cube", "cube:front", "equirectangular", "fisheye:kannala", "opencv", "colmap", "5X5_100", "0,0,1,1"),
)


def mutated_words(rng: Random, words: list[str], options: list[str], names: list[str]) -> list[str]:
    """A command line with one to four words changed; `options` are known ones, `names` files that are there."""
    words = list(words)
    for _ in range(rng.choice((0, 1, 1, 2, 4))):
        at = rng.randint(1, len(words))
        match rng.randrange(6):
            case 0:
                words.insert(at, rng.choice(VALUES))
            case 1:
                words[at:at] = [rng.choice(options), rng.choice((*VALUES, *names))]
            case 2:
                words.insert(at, rng.choice(names))
            case 3 if at < len(words):
                del words[at]
            case _ if at < len(words):
                words[at] = rng.choice((*VALUES, *names))
            case _:
                words.append(rng.choice(names))
    return words
