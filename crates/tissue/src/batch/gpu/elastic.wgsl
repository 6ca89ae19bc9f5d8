// Elastic forces of all cells and the gradient at the nodes. The law is that of `elastic.rs`.

// The seven modes of the displacement in a cell: x, y, z, xy, xz, yz, xyz.
fn modes(field: u32, cell: u32, column: u32) -> array<vec3<f32>, 7> {
    var v: array<vec3<f32>, 8>;
    for (var c = 0u; c < 8u; c++) {
        v[c] = vector(field, index[CELL_NODES + 8u * cell + c], column);
    }
    let p0 = v[0] + v[1];
    let p1 = v[2] + v[3];
    let p2 = v[4] + v[5];
    let p3 = v[6] + v[7];
    let m0 = v[1] - v[0];
    let m1 = v[3] - v[2];
    let m2 = v[5] - v[4];
    let m3 = v[7] - v[6];
    return array<vec3<f32>, 7>(
        0.25 * (m0 + m1 + (m2 + m3)),
        0.25 * (p1 - p0 + (p3 - p2)),
        0.25 * (p2 + p3 - (p0 + p1)),
        0.25 * (m1 - m0 + (m3 - m2)),
        0.25 * (m2 + m3 - (m0 + m1)),
        0.25 * (p3 - p2 - (p1 - p0)),
        0.25 * (m3 - m2 - (m1 - m0)),
    );
}

fn cofactor(f: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1]));
}

fn square(f: mat3x3<f32>) -> f32 {
    return dot(f[0], f[0]) + dot(f[1], f[1]) + dot(f[2], f[2]);
}

// Slope of the barrier at a volume ratio, over Young's modulus.
fn barrier(ratio: f32) -> f32 {
    if ratio >= LIMITED_RATIO {
        return 0.0;
    }
    let at = max(ratio, PARABOLA_RATIO);
    let fall = log(at / LIMITED_RATIO);
    return LIMIT_STRENGTH * (fall / at + (ratio - at) * (1.0 - fall) / (at * at));
}

// The stress of stretches beyond the limit: 2 mu F V max(D - 16, 0) V' with F'F = V D V', by
// Jacobi's rotations.
fn stretch_limit(f: mat3x3<f32>) -> mat3x3<f32> {
    var c = transpose(f) * f;
    var axes = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for (var round = 0u; round < 15u; round++) {
        let p = select(0u, 1u, round % 3u == 2u);
        let q = select(2u, 1u, round % 3u == 0u);
        let off = c[p][q];
        if off != 0.0 {
            let theta = 0.5 * (c[q][q] - c[p][p]) / off;
            let t = select(-1.0, 1.0, theta >= 0.0) / (abs(theta) + sqrt(theta * theta + 1.0));
            let cosine = inverseSqrt(t * t + 1.0);
            let sine = t * cosine;
            var turn = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
            turn[p][p] = cosine;
            turn[q][q] = cosine;
            turn[p][q] = -sine;
            turn[q][p] = sine;
            c = transpose(turn) * c * turn;
            axes = axes * turn;
        }
    }
    let beyond = 2.0 * SHEAR * max(vec3<f32>(c[0][0], c[1][1], c[2][2]) - LIMITED_SQUARE, vec3<f32>(0.0));
    let weighted = mat3x3<f32>(axes[0] * beyond.x, axes[1] * beyond.y, axes[2] * beyond.z);
    return f * (weighted * transpose(axes));
}

// Writes the forces of a cell at its corners, and its least volume ratio.
fn elastic(field: u32, cell: u32, column: u32) {
    let m = modes(field, cell, column);
    let volume = shape[CELL_NUMBERS + 2u * cell];
    let fill = shape[CELL_NUMBERS + 2u * cell + 1u];
    let middle = mat3x3<f32>(
        m[0] + vec3<f32>(1.0, 0.0, 0.0),
        m[1] + vec3<f32>(0.0, 1.0, 0.0),
        m[2] + vec3<f32>(0.0, 0.0, 1.0),
    );
    var a: array<vec3<f32>, 7>;
    if fill > 0.0 {
        let areas = cofactor(middle);
        let by = (dot(middle[0], areas[0]) - 1.0) * ((SHEAR / 3.0 + BULK) * fill) - SHEAR * fill;
        for (var c = 0u; c < 3u; c++) {
            a[c] = middle[c] * (SHEAR * fill) + areas[c] * by;
        }
        for (var mode = 3u; mode < 6u; mode++) {
            a[mode] = m[mode] * (SHEAR * fill * 2.0 / 3.0);
        }
        a[6] = m[6] * (SHEAR * fill / 3.0);
    }
    var low = 1.0;
    let weight = volume / 8.0;
    for (var point = 0u; point < 9u; point++) {
        let at = CELL_POINTS + 3u * (9u * cell + point);
        let x = shape[at];
        let y = shape[at + 1u];
        let z = shape[at + 2u];
        let f = mat3x3<f32>(
            middle[0] + m[3] * y + m[4] * z + m[6] * (y * z),
            middle[1] + m[3] * x + m[5] * z + m[6] * (x * z),
            middle[2] + m[4] * x + m[5] * y + m[6] * (x * y),
        );
        let areas = cofactor(f);
        let ratio = dot(f[0], areas[0]);
        var p: mat3x3<f32>;
        if point < 8u {
            low = min(low, select(-1.0, ratio, is_number(ratio)));
            let by = (ratio - 1.0) * (SHEAR * weight / 3.0) - SHEAR * weight + weight * barrier(ratio);
            p = f * (SHEAR * weight) + areas * by;
            if square(f) > LIMITED_SQUARE {
                p += stretch_limit(f) * weight;
            }
        } else {
            p = areas * ((ratio - 1.0) * (BULK * volume));
        }
        a[0] += p[0];
        a[1] += p[1];
        a[2] += p[2];
        a[3] += p[0] * y + p[1] * x;
        a[4] += p[0] * z + p[2] * x;
        a[5] += p[1] * z + p[2] * y;
        a[6] += p[0] * (y * z) + p[1] * (x * z) + p[2] * (x * y);
    }
    for (var c = 0u; c < 8u; c++) {
        let x = select(-0.25, 0.25, (c & 1u) != 0u);
        let y = select(-1.0, 1.0, (c & 2u) != 0u);
        let z = select(-1.0, 1.0, (c & 4u) != 0u);
        let force = x * (a[0] + y * a[3] + z * a[4] + (y * z) * a[6])
            + 0.25 * (y * a[1] + z * a[2] + (y * z) * a[5]);
        put(FORCES, 8u * cell + c, column, force);
    }
    data[(RATIO + cell) * COLUMNS + column] = low;
}

@compute @workgroup_size(64, 1)
fn cells_of_guess(@builtin(global_invocation_id) id: vec3<u32>) {
    if !is_set(IDLE, id.x) {
        elastic(U, id.y, id.x);
    }
}

@compute @workgroup_size(64, 1)
fn cells_of_flat(@builtin(global_invocation_id) id: vec3<u32>) {
    if is_set(FLAT, id.x) {
        elastic(U, id.y, id.x);
    }
}

@compute @workgroup_size(64, 1)
fn cells_of_trial(@builtin(global_invocation_id) id: vec3<u32>) {
    if !is_set(DONE, id.x) {
        elastic(TRIAL, id.y, id.x);
    }
}

// Writes the gradient at a node: inertia, pins and the forces of its cells, in this order.
fn gather(field: u32, to: u32, node: u32, column: u32) {
    var sum = vec3<f32>(0.0);
    if index[FIXED + node] == 0u {
        let heavy = scalar(INERTIA, column) * shape[MASSES + node];
        sum = (vector(field, node, column) - vector(PREDICTOR, node, column)) * heavy;
        for (var pin = index[PIN_STARTS + node]; pin < index[PIN_STARTS + node + 1u]; pin++) {
            sum += vector(field, index[PIN_NODES + pin], column) * shape[PINS + pin];
        }
        for (var part = index[CORNER_STARTS + node]; part < index[CORNER_STARTS + node + 1u]; part++) {
            sum += vector(FORCES, index[CORNERS + part], column);
        }
    }
    put(to, node, column, sum);
}

@compute @workgroup_size(64, 1)
fn gather_guess(@builtin(global_invocation_id) id: vec3<u32>) {
    if !is_set(IDLE, id.x) {
        gather(U, GRADIENT, id.y, id.x);
    }
}

@compute @workgroup_size(64, 1)
fn gather_trial(@builtin(global_invocation_id) id: vec3<u32>) {
    if !is_set(DONE, id.x) {
        gather(TRIAL, TRIAL_GRADIENT, id.y, id.x);
    }
}

// Adds the springs of a column's grasp.
fn pull(field: u32, to: u32, column: u32) {
    for (var spring = 0u; spring < SPRINGS; spring++) {
        let stiffness = scalar(STIFFNESS + spring, column);
        if stiffness == 0.0 {
            continue;
        }
        let first = control[SUBSTEP] * SPRINGS + spring;
        var off = -vector(TARGETS, first, column);
        for (var c = 8u * spring; c < 8u * spring + 8u; c++) {
            off += scalar(HELD_WEIGHTS + c, column) * vector(field, u32(scalar(HELD_NODES + c, column)), column);
        }
        for (var c = 8u * spring; c < 8u * spring + 8u; c++) {
            let node = u32(scalar(HELD_NODES + c, column));
            if index[FIXED + node] == 0u {
                let force = (scalar(HELD_WEIGHTS + c, column) * stiffness) * off;
                put(to, node, column, vector(to, node, column) + force);
            }
        }
    }
}

@compute @workgroup_size(64, 1)
fn pull_guess(@builtin(global_invocation_id) id: vec3<u32>) {
    if !is_set(IDLE, id.x) {
        pull(U, GRADIENT, id.x);
    }
}

@compute @workgroup_size(64, 1)
fn pull_trial(@builtin(global_invocation_id) id: vec3<u32>) {
    if !is_set(DONE, id.x) {
        pull(TRIAL, TRIAL_GRADIENT, id.x);
    }
}

// The rotation of the tissue about each node (`warp.rs`), by columns.
@compute @workgroup_size(64, 1)
fn turn_nodes(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    let node = id.y;
    if is_set(IDLE, column) {
        return;
    }
    var x = mat3x3<f32>();
    for (var part = index[CORNER_STARTS + node]; part < index[CORNER_STARTS + node + 1u]; part++) {
        let cell = index[CORNERS + part] / 8u;
        let m = modes(U, cell, column);
        let volume = shape[CELL_NUMBERS + 2u * cell];
        x += mat3x3<f32>(m[0] * volume, m[1] * volume, m[2] * volume);
    }
    x *= shape[TURNING + node];
    x[0].x += 1.0;
    x[1].y += 1.0;
    x[2].z += 1.0;
    if !(determinant(x) > TURNED_RATIO) {
        x = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    for (var round = 0u; round < 3u; round++) {
        let areas = cofactor(x);
        let over = 1.0 / dot(x[0], areas[0]);
        var scale = 1.0;
        if round == 0u {
            scale = sqrt(sqrt(square(areas) * over * over / square(x)));
        }
        x = x * (0.5 * scale) + areas * (0.5 * over / scale);
    }
    for (var c = 0u; c < 3u; c++) {
        put(ROTATIONS, 3u * node + c, column, x[c]);
    }
}
