/** Small meshes for the fake server's scene. */

export interface Mesh {
  vertices: Float32Array;
  triangles: Uint32Array;
}

/** A ball stretched along its axes, at a place (m). */
export function ball(centre: number[], radii: number[], rings: number, sectors: number): Mesh {
  const vertices: number[] = [];
  const triangles: number[] = [];
  for (let i = 0; i <= rings; i += 1) {
    const polar = (Math.PI * i) / rings;
    for (let j = 0; j < sectors; j += 1) {
      const around = (2 * Math.PI * j) / sectors;
      const bump = 1 + 0.05 * Math.sin(3 * around + 4 * polar);
      vertices.push(
        centre[0]! + radii[0]! * bump * Math.sin(polar) * Math.cos(around),
        centre[1]! + radii[1]! * bump * Math.sin(polar) * Math.sin(around),
        centre[2]! + radii[2]! * bump * Math.cos(polar),
      );
    }
  }
  for (let i = 0; i < rings; i += 1) {
    for (let j = 0; j < sectors; j += 1) {
      const [a, b] = [i * sectors + j, i * sectors + ((j + 1) % sectors)];
      triangles.push(a, a + sectors, b, b, a + sectors, b + sectors);
    }
  }
  return { vertices: Float32Array.from(vertices), triangles: Uint32Array.from(triangles) };
}

/** A rod along x from `from` to `to` (m). */
export function rod(from: number, to: number, radius: number, sides = 14): Mesh {
  const vertices: number[] = [];
  const triangles: number[] = [];
  for (const x of [from, to]) {
    for (let j = 0; j < sides; j += 1) {
      const a = (2 * Math.PI * j) / sides;
      vertices.push(x, radius * Math.cos(a), radius * Math.sin(a));
    }
  }
  for (let j = 0; j < sides; j += 1) {
    const k = (j + 1) % sides;
    triangles.push(j, k, sides + j, k, sides + k, sides + j);
  }
  return { vertices: Float32Array.from(vertices), triangles: Uint32Array.from(triangles) };
}

/** A level plate (m). */
export function plate(x: number, y: number, z: number, width: number, depth: number): Mesh {
  const [w, d] = [width / 2, depth / 2];
  return {
    vertices: Float32Array.from([x - w, y - d, z, x + w, y - d, z, x + w, y + d, z, x - w, y + d, z]),
    triangles: Uint32Array.from([0, 1, 2, 0, 2, 3]),
  };
}
