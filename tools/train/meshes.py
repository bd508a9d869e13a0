"""Triangle meshes and images of training scenes: binary PLY and 8-bit PNG, written with numpy alone."""
import struct
import zlib

import numpy as np


def write_ply(path, triangles):
    """Triangles of shape (n, 3, 8): position, normal (zero where there is none) and texture coordinates."""
    corners = np.asarray(triangles, np.float32).reshape(-1, 8)
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    faces = np.empty(len(corners) // 3, [("count", "u1"), ("index", "<i4", 3)])
    faces["count"], faces["index"] = 3, index.reshape(-1, 3)
    smooth = bool(np.abs(corners[:, 3:6]).max(initial=0) > 0)
    names = ["x", "y", "z"] + ["nx", "ny", "nz"] * smooth + ["u", "v"]
    if not smooth:
        vertices = np.delete(vertices, [3, 4, 5], 1)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_index", "end_header", ""]
    with open(path, "wb") as file:
        file.write("\n".join(header).encode() + vertices.astype("<f4").tobytes() + faces.tobytes())


def quads(parallelograms):
    """Triangles of parallelograms (corner, edge, edge), their texture coordinates in metres."""
    made = []
    for corner, a, b in parallelograms:
        corner, a, b = (np.asarray(v, float) for v in (corner, a, b))
        la, lb = np.linalg.norm(a), np.linalg.norm(b)
        at = lambda s, t: np.concatenate([corner + s * a + t * b, np.zeros(3), [s * la, t * lb]])
        made += [[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]
    return np.array(made)


def box(low, high):
    """Triangles of the six sides of a box, their normals outwards."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    x, y, z = np.diag(high - low)
    return quads([(low, y, x), (low, x, z), (low, z, y), (high, -x, -y), (high, -z, -x), (high, -y, -z)])


def moved(triangles, angle=0.0, by=(0, 0, 0)):
    """Triangles turned about the vertical axis by an angle in radians, then moved."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    made = np.array(triangles, float)
    made[..., :3] = made[..., :3] @ turn.T + np.asarray(by)
    made[..., 3:6] = made[..., 3:6] @ turn.T
    return made


def write_png(path, image):
    """An image of values from 0 to 1, of shape (height, width, 3)."""
    levels = (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)
    height, width, _ = levels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), levels.reshape(height, -1)], 1)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6))
                   + chunk(b"IEND", b""))
