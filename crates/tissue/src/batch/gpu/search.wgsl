// A substep's search in each column: `search.rs`, a column for a lane. A workgroup has eight
// columns; the nodes of a column are shared by 32 threads, whose sums are added in a fixed order.

const GROUP: u32 = 8u;
const SHARES: u32 = 32u;

var<workgroup> sums: array<f32, 256>;
var<workgroup> motion: array<f32, 256>;
var<workgroup> force: array<f32, 256>;

// The sum of a column's threads.
fn total(local: vec3<u32>, value: f32) -> f32 {
    let own = local.y * GROUP + local.x;
    sums[own] = value;
    workgroupBarrier();
    for (var half = SHARES / 2u; half > 0u; half /= 2u) {
        if local.y < half {
            sums[own] += sums[own + half * GROUP];
        }
        workgroupBarrier();
    }
    let sum = sums[local.x];
    workgroupBarrier();
    return sum;
}

// The least number of a column's threads.
fn lowest(local: vec3<u32>, value: f32) -> f32 {
    let own = local.y * GROUP + local.x;
    sums[own] = value;
    workgroupBarrier();
    for (var half = SHARES / 2u; half > 0u; half /= 2u) {
        if local.y < half {
            sums[own] = min(sums[own], sums[own + half * GROUP]);
        }
        workgroupBarrier();
    }
    let least = sums[local.x];
    workgroupBarrier();
    return least;
}

fn least_ratio(local: vec3<u32>, column: u32) -> f32 {
    var low = 1.0;
    for (var cell = local.y; cell < CELLS; cell += SHARES) {
        low = min(low, data[(RATIO + cell) * COLUMNS + column]);
    }
    return lowest(local, low);
}

// Where the columns begin, and the guess.
@compute @workgroup_size(64, 1)
fn begin(@builtin(global_invocation_id) id: vec3<u32>) {
    let column = id.x;
    let start = vector(U, id.y, column);
    let flown = start + vector(V, id.y, column) * SUBSTEP_LENGTH;
    let gravity = vec3<f32>(scalar(GRAVITY, column), scalar(GRAVITY + 1u, column), scalar(GRAVITY + 2u, column));
    put(START, id.y, column, start);
    put(U, id.y, column, flown);
    put(PREDICTOR, id.y, column, flown + gravity * (SUBSTEP_LENGTH * SUBSTEP_LENGTH));
    if id.y == 0u {
        write(DONE, column, scalar(IDLE, column));
        write(FRESH, column, 1.0);
        write(SHARE, column, 1.0);
        write(SLOPE, column, 0.0);
        write(SIZE, column, 0.0);
        write(REJECTED, column, 0.0);
        write(USED, column, 0.0);
        write(CONVERGED, column, 0.0);
    }
}

// A column whose guess turns a cell inside out begins where it was.
@compute @workgroup_size(8, 32)
fn check_guess(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let column = group.x * GROUP + local.x;
    let flat = !(least_ratio(local, column) >= MIN_RATIO) && !is_set(IDLE, column);
    if flat {
        for (var node = local.y; node < NODES; node += SHARES) {
            put(U, node, column, vector(START, node, column));
        }
    }
    if local.y == 0u {
        write(FLAT, column, select(0.0, 1.0, flat));
    }
}

@compute @workgroup_size(8, 32)
fn survey(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let column = group.x * GROUP + local.x;
    let least = least_ratio(local, column);
    let way = total(local, distance_from_start(local, column));
    if local.y == 0u {
        write(LEAST, column, least);
        write(WAY, column, way);
    }
}

fn distance_from_start(local: vec3<u32>, column: u32) -> f32 {
    var off = 0.0;
    for (var node = local.y; node < NODES; node += SHARES) {
        let by = vector(U, node, column) - vector(START, node, column);
        off += dot(by, by) * shape[WEIGHTS + node];
    }
    return off;
}

// The first half of L-BFGS: the gradient less what the pairs know, in the frame at rest.
@compute @workgroup_size(8, 32)
fn before_solve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let column = group.x * GROUP + local.x;
    let acts = is_set(FRESH, column) && !is_set(DONE, column);
    let pairs = control[ROUND];
    if acts {
        for (var node = local.y; node < NODES; node += SHARES) {
            put(SOLUTION, node, column, vector(GRADIENT, node, column));
        }
    }
    for (var back = 1u; back <= MEMORY; back++) {
        let there = acts && back <= pairs;
        let slot = (pairs + MEMORY - min(back, pairs)) % MEMORY;
        var product = 0.0;
        if there {
            for (var node = local.y; node < NODES; node += SHARES) {
                product += dot(vector(STEPS + slot * ROWS, node, column), vector(SOLUTION, node, column));
            }
        }
        let by = total(local, product) * scalar(INVERSES + slot, column);
        if there {
            for (var node = local.y; node < NODES; node += SHARES) {
                let changed = vector(SOLUTION, node, column) - by * vector(CHANGES + slot * ROWS, node, column);
                put(SOLUTION, node, column, changed);
            }
            if local.y == 0u {
                write(SHARES_OF_PAIRS + slot, column, by);
            }
        }
    }
    if acts {
        for (var node = local.y; node < NODES; node += SHARES) {
            put(SOLUTION, node, column, vector(SOLUTION, node, column) * rotation(node, column));
        }
    }
}

fn rotation(node: u32, column: u32) -> mat3x3<f32> {
    return mat3x3<f32>(
        vector(ROTATIONS, 3u * node, column),
        vector(ROTATIONS, 3u * node + 1u, column),
        vector(ROTATIONS, 3u * node + 2u, column),
    );
}

// The second half: the grasp's part of the inverse, the pairs, and the choice of a step.
@compute @workgroup_size(8, 32)
fn after_solve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let column = group.x * GROUP + local.x;
    let own = local.y * GROUP + local.x;
    let acts = is_set(FRESH, column) && !is_set(DONE, column);
    let pairs = control[ROUND];
    var moved = 0.0;
    if acts && local.y < RANK {
        let spring = local.y / 3u;
        for (var c = 8u * spring; c < 8u * spring + 8u; c++) {
            let row = 3u * u32(scalar(HELD_NODES + c, column)) + local.y % 3u;
            moved += scalar(HELD_WEIGHTS + c, column) * data[(SOLVED + row) * COLUMNS + column];
        }
    }
    motion[own] = moved;
    workgroupBarrier();
    var pulled = 0.0;
    if acts && local.y < RANK {
        for (var axis = 0u; axis < RANK; axis++) {
            pulled += scalar(RESISTANCE + axis * RANK + local.y, column) * motion[axis * GROUP + local.x];
        }
    }
    force[own] = pulled;
    workgroupBarrier();
    if acts {
        for (var node = local.y; node < NODES; node += SHARES) {
            var x = vector(SOLVED, node, column);
            for (var axis = 0u; axis < RANK; axis++) {
                x -= vector(RESPONSES + axis * ROWS, node, column) * force[axis * GROUP + local.x];
            }
            put(SOLUTION, node, column, rotation(node, column) * x);
        }
    }
    for (var back = MEMORY; back > 0u; back--) {
        let there = acts && back <= pairs;
        let slot = (pairs + MEMORY - min(back, pairs)) % MEMORY;
        var product = 0.0;
        if there {
            for (var node = local.y; node < NODES; node += SHARES) {
                product += dot(vector(CHANGES + slot * ROWS, node, column), vector(SOLUTION, node, column));
            }
        }
        product = total(local, product);
        if there {
            let by = scalar(SHARES_OF_PAIRS + slot, column) - product * scalar(INVERSES + slot, column);
            for (var node = local.y; node < NODES; node += SHARES) {
                let changed = vector(SOLUTION, node, column) + by * vector(STEPS + slot * ROWS, node, column);
                put(SOLUTION, node, column, changed);
            }
        }
    }
    var slope = 0.0;
    var size = 0.0;
    if acts {
        for (var node = local.y; node < NODES; node += SHARES) {
            let x = vector(SOLUTION, node, column);
            slope -= dot(x, vector(GRADIENT, node, column));
            size += dot(x, x) * shape[WEIGHTS + node];
        }
    }
    slope = total(local, slope);
    size = total(local, size);
    let live = !is_set(DONE, column);
    let way = scalar(WAY, column);
    let share = scalar(SHARE, column);
    if !acts {
        slope = scalar(SLOPE, column);
        size = scalar(SIZE, column);
    }
    // All have read what the first thread of a column writes.
    storageBarrier();
    // No way down: rounding, or numbers that are none.
    let lost = !(slope < 0.0) || !is_number(slope);
    // The last step is not looked at.
    let small = acts && !lost && size <= max(TOLERANCE, way * RELATIVE);
    if !live {
        return;
    }
    for (var node = local.y; node < NODES; node += SHARES) {
        var step = -vector(SOLUTION, node, column);
        if acts {
            put(DIRECTION, node, column, step);
        } else {
            step = vector(DIRECTION, node, column);
        }
        let at = vector(U, node, column);
        if small {
            put(U, node, column, at + step);
        } else {
            put(TRIAL, node, column, at + step * share);
        }
    }
    if local.y == 0u {
        write(SLOPE, column, slope);
        write(SIZE, column, size);
        if small {
            write(CONVERGED, column, 1.0);
        }
        if lost || small {
            write(DONE, column, 1.0);
        } else {
            write(USED, column, scalar(USED, column) + 1.0);
        }
    }
}

// Takes the trial or shortens the step, and keeps the pair.
@compute @workgroup_size(8, 32)
fn judge(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let column = group.x * GROUP + local.x;
    let acts = !is_set(DONE, column);
    let slot = control[ROUND] % MEMORY;
    var end = 0.0;
    var change = 0.0;
    if acts {
        for (var node = local.y; node < NODES; node += SHARES) {
            let g = vector(TRIAL_GRADIENT, node, column);
            let y = g - vector(GRADIENT, node, column);
            end += dot(g, vector(DIRECTION, node, column));
            change += dot(y, y);
        }
    }
    end = total(local, end);
    change = total(local, change);
    let ratio = least_ratio(local, column);
    let least = scalar(LEAST, column);
    let slope = scalar(SLOPE, column);
    let share = scalar(SHARE, column);
    let sound = is_number(change) && is_number(end) && ratio >= min(least, MIN_RATIO);
    let accepted = acts && sound && end <= -slope * OVERSHOOT;
    let curvature = share * (end - slope);
    let kept = accepted && curvature > -share * slope * MIN_CURVATURE;
    var way = 0.0;
    if acts {
        for (var node = local.y; node < NODES; node += SHARES) {
            let g = vector(TRIAL_GRADIENT, node, column);
            var step = vec3<f32>(0.0);
            var y = vec3<f32>(0.0);
            if kept {
                step = vector(DIRECTION, node, column) * share;
                y = g - vector(GRADIENT, node, column);
            }
            put(STEPS + slot * ROWS, node, column, step);
            put(CHANGES + slot * ROWS, node, column, y);
            if accepted {
                put(GRADIENT, node, column, g);
                let at = vector(TRIAL, node, column);
                put(U, node, column, at);
                let by = at - vector(START, node, column);
                way += dot(by, by) * shape[WEIGHTS + node];
            }
        }
    }
    way = total(local, way);
    // All have read what the first thread of a column writes.
    storageBarrier();
    if acts && local.y == 0u {
        write(INVERSES + slot, column, select(0.0, 1.0 / curvature, kept));
        write(FRESH, column, select(0.0, 1.0, accepted));
        if accepted {
            write(WAY, column, way);
            write(LEAST, column, ratio);
            write(SHARE, column, 1.0);
            write(REJECTED, column, 0.0);
        } else {
            // The secant's zero of the slope, within bounds.
            let secant = -slope / (end - slope);
            let within = sound && secant >= SHORTEST;
            write(SHARE, column, share * min(select(SHORTEST, secant, within), LONGEST));
            let rejected = scalar(REJECTED, column) + 1.0;
            write(REJECTED, column, rejected);
            if rejected >= MAX_REJECTED {
                write(DONE, column, 1.0);
            }
        }
    }
}

// Goes on to the next round, and counts the columns that are not done.
@compute @workgroup_size(256)
fn next_round(@builtin(local_invocation_index) own: u32) {
    var going = 0.0;
    for (var column = own; column < COLUMNS; column += 256u) {
        going += 1.0 - scalar(DONE, column);
    }
    sums[own] = going;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half /= 2u) {
        if own < half {
            sums[own] += sums[own + half];
        }
        workgroupBarrier();
    }
    if own == 0u {
        control[ACTIVE] = u32(sums[0]);
        control[ROUND] += 1u;
    }
}

// Velocities. A column with numbers that are none stays where it began, at rest; idle ones keep all.
@compute @workgroup_size(8, 32)
fn finish(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let column = group.x * GROUP + local.x;
    let idle = is_set(IDLE, column);
    let sound = is_number(total(local, distance_from_start(local, column)));
    for (var node = local.y; node < NODES; node += SHARES) {
        let start = vector(START, node, column);
        var speed = vec3<f32>(0.0);
        if sound && !idle {
            speed = (vector(U, node, column) - start) * (1.0 / SUBSTEP_LENGTH);
        } else {
            put(U, node, column, start);
        }
        if !idle {
            put(V, node, column, speed);
        }
    }
    if local.y == 0u {
        write(ROUNDS, column, scalar(ROUNDS, column) + scalar(USED, column));
        let failed = !(is_set(CONVERGED, column) && sound);
        write(UNCONVERGED, column, scalar(UNCONVERGED, column) + select(0.0, 1.0, failed));
        if idle || !sound {
            write(DAMAGED, column, 1.0);
        }
    }
}
