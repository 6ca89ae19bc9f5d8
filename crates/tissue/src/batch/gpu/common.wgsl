// What all passes share. Constants in capitals that are not declared here are written before this
// text by `layout.rs`. A column is an instance; the numbers of all columns lie side by side.

@group(0) @binding(0) var<storage, read_write> data: array<f32>;
@group(0) @binding(1) var<storage, read_write> control: array<u32>;
@group(0) @binding(2) var<storage, read> shape: array<f32>;
@group(0) @binding(3) var<storage, read> index: array<u32>;
@group(0) @binding(4) var<storage, read> inverse: array<f32>;

// Places in `control`.
const ROUND: u32 = 0u;
const ACTIVE: u32 = 1u;
const SUBSTEP: u32 = 2u;

fn vector(field: u32, node: u32, column: u32) -> vec3<f32> {
    let at = (field + 3u * node) * COLUMNS + column;
    return vec3<f32>(data[at], data[at + COLUMNS], data[at + 2u * COLUMNS]);
}

fn put(field: u32, node: u32, column: u32, value: vec3<f32>) {
    let at = (field + 3u * node) * COLUMNS + column;
    data[at] = value.x;
    data[at + COLUMNS] = value.y;
    data[at + 2u * COLUMNS] = value.z;
}

fn scalar(row: u32, column: u32) -> f32 {
    return data[row * COLUMNS + column];
}

fn write(row: u32, column: u32, value: f32) {
    data[row * COLUMNS + column] = value;
}

fn is_set(row: u32, column: u32) -> bool {
    return scalar(row, column) != 0.0;
}

// Whether a number is finite. Shading languages may assume that all are, so the bits are asked.
fn is_number(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}
