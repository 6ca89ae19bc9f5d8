// The preconditioner: the dense inverse of the stiffness at rest times all columns.

const TILE: u32 = 64u;
const DEPTH: u32 = 16u;

var<workgroup> left: array<vec4<f32>, 256>;
var<workgroup> right: array<vec4<f32>, 256>;
var<workgroup> wanted: array<u32, 64>;
var<workgroup> any_wanted: u32;

// Tiles of 64 rows by 64 columns, 4 by 4 numbers a thread. The columns of a tile have one factor.
@compute @workgroup_size(16, 16)
fn solve(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) own: u32,
) {
    if own < TILE {
        let column = group.x * TILE + own;
        wanted[own] = select(0u, 1u, is_set(FRESH, column) && !is_set(DONE, column));
    }
    workgroupBarrier();
    if own == 0u {
        var count = 0u;
        for (var i = 0u; i < TILE; i++) {
            count += wanted[i];
        }
        any_wanted = count;
    }
    if workgroupUniformLoad(&any_wanted) == 0u {
        return;
    }
    let matrix = index[FACTORS + group.x] * PADDED * PADDED + group.y * TILE;
    let field = SOLUTION * COLUMNS + group.x * TILE;
    var result: array<vec4<f32>, 4>;
    // Each thread carries four numbers of both tiles.
    let k = own / 16u;
    let four = 4u * (own % 16u);
    for (var depth = 0u; depth < PADDED; depth += DEPTH) {
        let m = matrix + (depth + k) * PADDED + four;
        let f = field + (depth + k) * COLUMNS + four;
        left[own] = vec4<f32>(inverse[m], inverse[m + 1u], inverse[m + 2u], inverse[m + 3u]);
        right[own] = vec4<f32>(data[f], data[f + 1u], data[f + 2u], data[f + 3u]);
        workgroupBarrier();
        for (var i = 0u; i < DEPTH; i++) {
            let rows = left[16u * i + local.y];
            let columns = right[16u * i + local.x];
            result[0] += rows.x * columns;
            result[1] += rows.y * columns;
            result[2] += rows.z * columns;
            result[3] += rows.w * columns;
        }
        workgroupBarrier();
    }
    for (var r = 0u; r < 4u; r++) {
        let row = SOLVED + group.y * TILE + 4u * local.y + r;
        let to = row * COLUMNS + group.x * TILE + 4u * local.x;
        for (var c = 0u; c < 4u; c++) {
            data[to + c] = result[r][c];
        }
    }
}

// Motion of the nodes under a unit force at each axis of a grasp.
@compute @workgroup_size(64, 1)
fn respond(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    let matrix = index[FACTORS + column / TILE] * PADDED * PADDED;
    for (var axis = 0u; axis < RANK; axis++) {
        let spring = axis / 3u;
        var moved = vec3<f32>(0.0);
        if scalar(STIFFNESS + spring, column) != 0.0 {
            for (var c = 8u * spring; c < 8u * spring + 8u; c++) {
                let first = matrix + (3u * u32(scalar(HELD_NODES + c, column)) + axis % 3u) * PADDED + 3u * id.y;
                moved += scalar(HELD_WEIGHTS + c, column)
                    * vec3<f32>(inverse[first], inverse[first + 1u], inverse[first + 2u]);
            }
        }
        put(RESPONSES + axis * ROWS, id.y, column, moved);
    }
}
