static void bench_draw(const bench_report *r) { (void)r; }
