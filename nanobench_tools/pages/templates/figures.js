"use strict";
// A page of figures only: all there are, each when it comes near.
nanobench.start("data-drawings").then(() => { document.documentElement.dataset.ready = "all"; });
