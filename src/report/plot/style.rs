//! Style sheets of the plots and their pages.

/// Style of every plot, for light and dark backgrounds. The colours of `c0` (blue) and `c1` (orange) are
/// distinguishable with any colour vision.
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
.plot .c3{stroke:#007a55}.plot .fill.c3{stroke:none}.plot .c3.fill,.plot .c3.area,.plot .c3.veil{fill:#007a55}\
.plot .c4{stroke:#8a3fa0}.plot .fill.c4{stroke:none}.plot .c4.fill,.plot .c4.area,.plot .c4.veil{fill:#8a3fa0}\
.plot .c5{stroke:#8a6d00}.plot .fill.c5{stroke:none}.plot .c5.fill,.plot .c5.area,.plot .c5.veil{fill:#8a6d00}\
.plot .c6{stroke:#b0205a}.plot .fill.c6{stroke:none}.plot .c6.fill,.plot .c6.area,.plot .c6.veil{fill:#b0205a}\
.plot .c7{stroke:#006f80}.plot .fill.c7{stroke:none}.plot .c7.fill,.plot .c7.area,.plot .c7.veil{fill:#006f80}\
.plot .dash{stroke-dasharray:5 4}\
@media(prefers-color-scheme:dark){\
.plot text{fill:#ddd}\
.plot .frame{stroke:#888}\
.plot .faint{stroke:#aaa}\
.plot .c0{stroke:#6cb8f0}.plot .c0.fill,.plot .c0.area,.plot .c0.veil{fill:#6cb8f0}\
.plot .c1{stroke:#f0a050}.plot .c1.fill,.plot .c1.area,.plot .c1.veil{fill:#f0a050}\
.plot .c3{stroke:#4cc79a}.plot .c3.fill,.plot .c3.area,.plot .c3.veil{fill:#4cc79a}\
.plot .c4{stroke:#c890dc}.plot .c4.fill,.plot .c4.area,.plot .c4.veil{fill:#c890dc}\
.plot .c5{stroke:#d4b840}.plot .c5.fill,.plot .c5.area,.plot .c5.veil{fill:#d4b840}\
.plot .c6{stroke:#f080a8}.plot .c6.fill,.plot .c6.area,.plot .c6.veil{fill:#f080a8}\
.plot .c7{stroke:#58c4d4}.plot .c7.fill,.plot .c7.area,.plot .c7.veil{fill:#58c4d4}\
.plot .c2{stroke:#bbb}.plot .c2.fill,.plot .c2.area,.plot .c2.veil{fill:#bbb}}\
";

/// Style of pages with plots, such as reports.
pub const PAGE_STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:15px/1.45 system-ui,sans-serif;max-width:1000px;margin:1.5em auto;padding:0 1em;\
background:#fff;color:#222}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums;margin:.6em 0}\
th,td{padding:.15em .7em;text-align:right;border-bottom:1px solid #8884}\
th:first-child,td:first-child{text-align:left}\
td.words{text-align:left}\
.wide{overflow-x:auto}\
.note{color:#666;max-width:46em}\
.warning{border-left:4px solid #c24a00;padding-left:.8em}\
figure{display:inline-block;margin:.4em}figure img{max-width:300px;height:auto}\
figure.large img{max-width:100%}\
a{color:#0060a8}\
@media(prefers-color-scheme:dark){body{background:#16181a;color:#ddd}.note{color:#aaa}\
.warning{border-color:#f0a050}a{color:#6cb8f0}}\
";
