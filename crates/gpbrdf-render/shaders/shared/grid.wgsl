// The grid of a baked table: cells along theta_h, theta_d and phi_d.

const N_THETA_H: u32 = 90u;
const N_THETA_D: u32 = 90u;
const N_PHI_D: u32 = 180u;

// phi_d and pi - phi_d reach the horizon at the same theta_d, so that their cells share a column.
const N_COLUMNS: u32 = N_PHI_D / 2u;

// The column of a cell along phi_d.
fn column_of(i_phi_d: u32) -> u32 {
    return min(i_phi_d, N_PHI_D - 1u - i_phi_d);
}

// Where the column of a cell is in arrays of the layout [i_theta_h][column].
fn column_index(i_theta_h: u32, i_phi_d: u32) -> u32 {
    return i_theta_h * N_COLUMNS + column_of(i_phi_d);
}

// Where a target is in arrays of the layout [i_theta_h][row][i_theta_d]. There are `rows` rows along phi_d:
// as many as columns where phi_d is folded, else as many as cells.
fn target_index(i_theta_h: u32, row: u32, i_theta_d: u32, rows: u32) -> u32 {
    return (i_theta_h * rows + row) * N_THETA_D + i_theta_d;
}
