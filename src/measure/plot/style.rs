//! What the classes of the plots look like.

/// Style of every plot, on light and on dark ground. The colours of `c0` (blue) and `c1` (orange) are
/// told apart by readers of any colour vision.
pub const STYLE: &str = "\
.plot{font:12px system-ui,sans-serif;max-width:100%;height:auto}\
.plot text{fill:#333}\
.plot .name{font-weight:600}\
.plot .frame{fill:none;stroke:#999}\
.plot .grid{stroke:#888;stroke-opacity:.22}\
.plot .line{fill:none;stroke-width:1.5}\
.plot .thin{fill:none;stroke-width:.8;stroke-opacity:.75}\
.plot .faint{fill:none;stroke:#777;stroke-width:.8}\
.plot .ring{fill:none;stroke:#c00000;stroke-width:1.5}\
.plot .fill{fill-opacity:.85}\
.plot .area{fill-opacity:.12;stroke-width:1}\
.plot .veil{fill-opacity:.04;stroke-width:.8;stroke-opacity:.7}\
.plot .c0{stroke:#0060a8}.plot .fill.c0{stroke:none}.plot .c0.fill,.plot .c0.area,.plot .c0.veil{fill:#0060a8}\
.plot .c1{stroke:#c24a00}.plot .fill.c1{stroke:none}.plot .c1.fill,.plot .c1.area,.plot .c1.veil{fill:#c24a00}\
.plot .c2{stroke:#555}.plot .fill.c2{stroke:none}.plot .c2.fill,.plot .c2.area,.plot .c2.veil{fill:#555}\
@media(prefers-color-scheme:dark){\
.plot text{fill:#ddd}\
.plot .frame{stroke:#888}\
.plot .faint{stroke:#aaa}\
.plot .c0{stroke:#6cb8f0}.plot .c0.fill,.plot .c0.area,.plot .c0.veil{fill:#6cb8f0}\
.plot .c1{stroke:#f0a050}.plot .c1.fill,.plot .c1.area,.plot .c1.veil{fill:#f0a050}\
.plot .c2{stroke:#bbb}.plot .c2.fill,.plot .c2.area,.plot .c2.veil{fill:#bbb}}\
";
