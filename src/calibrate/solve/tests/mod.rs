mod exact;
mod scene;
