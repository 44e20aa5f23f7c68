mod degenerate;
mod derivatives;
mod exact;
mod honest;
mod outliers;
mod scene;
mod stiff;
mod which_coefficients;
