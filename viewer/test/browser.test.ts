/** All tests in a browser, one after another: they share it. */

import "./page.ts";
import "./drive.ts";
import "./layout.ts";
import "./real.ts";
