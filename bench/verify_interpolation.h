/* verify_interpolation.h: how well sums over neighbours stand for integrals, against the number of
   neighbours, for every kernel: on a cubic and a hexagonal lattice and on points that are
   disordered and settled, as particles of a flow are. Equal volumes V, one h, periodic unit box:
     sum         | sum_j V W - 1 |: the density of an even gas
     force       h | sum_j V grad W |: the push that even pressure gives, 0 by symmetry on a lattice
     divergence  | -1/dim sum_j V (x_i - x_j) . grad W - 1 |: the divergence of v = x, over dim */
#ifndef VERIFY_INTERPOLATION_H
#define VERIFY_INTERPOLATION_H

typedef struct verify_cloud {
    int dim;
    size_t n;
    double *x, *support; /* (n,3), (n) */
    sphpa_box box;
} verify_cloud;

static verify_cloud verify_cloud_of(const sphpa_particles *p, double low, double high) {
    verify_cloud points;
    memset(&points, 0, sizeof points);
    points.dim = p->dim;
    points.n = p->n;
    points.x = (double *)malloc(3 * p->n * sizeof *points.x);
    points.support = (double *)malloc(p->n * sizeof *points.support);
    if (points.x == NULL || points.support == NULL) example_fail(1, "verify: out of memory");
    memcpy(points.x, p->x, 3 * p->n * sizeof *points.x);
    verify_periodic(&points.box, p->dim, low, high);
    return points;
}

static void verify_cloud_free(verify_cloud *points) {
    free(points->x);
    free(points->support);
}

/* neighbours of all within `radius`; the lists are in the tree's order */
static void verify_cloud_list(verify_cloud *points, double radius, sphpa_tree *tree,
                               sphpa_tree_lists *lists) {
    sphpa_error err;
    for (size_t i = 0; i < points->n; i++) points->support[i] = radius;
    verify_must(sphpa_tree_build(tree, points->dim, points->n, points->x, points->support,
                                 &points->box, &err), &err);
    verify_must(sphpa_tree_lists_build(tree, 0.0, 1, lists, &err), &err);
}

/* x_i - x_j of the nearest image in the unit box; returns the distance */
static double verify_cloud_apart(const sphpa_tree *tree, size_t i, size_t j, double dx[3]) {
    double square = 0.0;
    for (int a = 0; a < 3; a++) {
        dx[a] = tree->pos[4 * i + (size_t)a] - tree->pos[4 * j + (size_t)a];
        dx[a] -= rint(dx[a]);
        square += dx[a] * dx[a];
    }
    return sqrt(square);
}

/* Disorder: each point of a lattice is moved by up to 0.4 spacings along each axis, then 30 steps
   down the gradient of the concentration, dx = -h^2/4 sum V grad W (Lind et al. 2012, J. Comput.
   Phys. 231), with Wendland's C2, which does not pair. The generator's seed is fixed. */
static void verify_cloud_settle(verify_cloud *points, double spacing) {
    sphpa_tree tree;
    sphpa_tree_lists lists;
    sphpa_rng rng = sphpa_rng_seed(4, (uint64_t)points->dim);
    double h = 1.6 * spacing, volume = 1.0 / (double)points->n;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    for (size_t i = 0; i < points->n; i++)
        for (int a = 0; a < points->dim; a++)
            points->x[3 * i + (size_t)a] += 0.8 * spacing * (sphpa_rng_uniform(&rng) - 0.5);
    for (int step = 0; step <= 30; step++) {
        for (size_t i = 0; i < points->n; i++)
            for (int a = 0; a < points->dim; a++) {
                double *x = &points->x[3 * i + (size_t)a];
                *x -= floor(*x);
                if (*x >= 1.0) *x = 0.0;
            }
        if (step == 30) break;
        verify_cloud_list(points, 2.0 * h, &tree, &lists);
        for (size_t k = 0; k < points->n; k++) {
            size_t count;
            const uint32_t *list = sphpa_tree_list_of(&lists, k, &count);
            for (size_t q = 0; q < count; q++) {
                size_t j = SPHPA_TREE_ENTRY_INDEX(list[q]);
                double dx[3], r = verify_cloud_apart(&tree, k, j, dx);
                double dw = sphpa_kernel_dw(SPHPA_KERNEL_WENDLAND_C2, points->dim, r, h);
                for (int a = 0; a < points->dim; a++)
                    points->x[3 * (size_t)tree.order[k] + (size_t)a] -=
                        0.25 * h * h * volume * dw * dx[a] / fmax(r, 1e-12 * h);
            }
        }
    }
    sphpa_tree_lists_free(&lists);
    sphpa_tree_free(&tree);
}

/* the three sums' errors at all points, with smoothing length h */
static void verify_cloud_sums(verify_cloud *points, sphpa_kernel kernel, double h,
                               verify_error e[3], double *neighbours, double *cpu_s) {
    sphpa_tree tree;
    sphpa_tree_lists lists;
    double volume = 1.0 / (double)points->n, scratch = 0.0;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    memset(e, 0, 3 * sizeof *e);
    clock_t begun = clock();
    verify_cloud_list(points, sphpa_kernel_support(kernel) * h, &tree, &lists);
    for (size_t k = 0; k < points->n; k++) {
        size_t count;
        const uint32_t *list = sphpa_tree_list_of(&lists, k, &count);
        double sum = 0.0, div = 0.0, push[3] = {0, 0, 0};
        for (size_t q = 0; q < count; q++) { /* the point itself is among them */
            size_t j = SPHPA_TREE_ENTRY_INDEX(list[q]);
            double dx[3], r = verify_cloud_apart(&tree, k, j, dx);
            double dw = sphpa_kernel_dw(kernel, points->dim, r, h);
            sum += sphpa_kernel_w(kernel, points->dim, r, h);
            if (j == k) continue;
            div -= r * dw;
            for (int a = 0; a < 3; a++) push[a] += dw * dx[a] / r;
        }
        verify_error_add(&e[0], volume * sum - 1.0);
        verify_error_add(&e[1], h * volume * sqrt(push[0] * push[0] + push[1] * push[1] +
                                                  push[2] * push[2]));
        verify_error_add(&e[2], volume * div / points->dim - 1.0);
        scratch += (double)count - 1.0;
    }
    *cpu_s = (double)(clock() - begun) / (double)CLOCKS_PER_SEC;
    *neighbours = scratch / (double)points->n;
    sphpa_tree_lists_free(&lists);
    sphpa_tree_free(&tree);
}

/* The rows of one arrangement, kernel and neighbour number. On the cubic lattice the sum's error is
   known: Poisson's formula. 1e-4 is what that series, cut off, leaves of the roughest kernels,
   whose transforms fall with the fourth power in one dimension; the Gaussian ends in a jump, its
   series does not converge: reported. */
static void verify_cloud_rows(verify *v, verify_cloud *points, const char *arrangement,
                               sphpa_kernel kernel, double eta) {
    static const char *const what[3] = {"sum", "force", "divergence"};
    verify_error e[3];
    double neighbours, cpu_s, spacing = pow(1.0 / (double)points->n, 1.0 / points->dim);
    bool lattice = strcmp(arrangement, "lattice") == 0;
    verify_cloud_sums(points, kernel, eta * spacing, e, &neighbours, &cpu_s);
    for (int k = 0; k < 3; k++) {
        char name[VERIFY_NAME];
        snprintf(name, sizeof name, "kernel-%s-%dd", what[k], points->dim);
        verify_row row = verify_row_of(name, arrangement, sphpa_kernel_name(kernel), 0);
        row.n = (double)points->n;
        row.neighbours = neighbours;
        row.cpu_s = cpu_s;
        verify_error_put(&row, &e[k]);
        /* every term has its mirror image: rounding of some 1e2 terms of order 1 */
        if (k == 1 && lattice) verify_limit(&row, "linf_error", "<=", 1e-12);
        verify_add(v, row);
        if (k > 0 || !lattice || kernel == SPHPA_KERNEL_GAUSSIAN) continue;
        row = verify_also(&row, "kernel-sum-poisson");
        row.l1_error = row.linf_error =
            fabs(e[0].sum / (double)e[0].count -
                 fabs(verify_lattice_bias(kernel, points->dim, eta)));
        verify_limit(&row, "l1_error", "<=", 1e-4);
        verify_add(v, row);
    }
}

/* numbers of neighbours, itself counted, of the volume of the kernel's support */
static void verify_cloud_kernels(verify *v, verify_cloud *points, const char *arrangement) {
    static const double wanted[4][7] = {{0},
                                        {4.4, 5.2, 6.3, 8.3, 10.3, 12.3, 16.3},
                                        {12, 16, 20, 28, 40, 60, 80},
                                        {33, 48, 64, 100, 160, 250, 400}};
    static const double ball[4] = {1.0, 2.0, VERIFY_PI, 4.0 / 3.0 * VERIFY_PI};
    for (int k = 0; k < SPHPA_KERNEL_COUNT; k++)
        for (int number = 0; number < 7; number++) {
            double radius = pow(wanted[points->dim][number] / ball[points->dim], 1.0 / points->dim);
            double eta = radius / sphpa_kernel_support((sphpa_kernel)k);
            verify_cloud_rows(v, points, arrangement, (sphpa_kernel)k, eta);
        }
}

static void verify_interpolation(verify *v, int dim) {
    static const int across[4] = {0, 100, 36, 16};
    for (int kind = 0; kind < 3; kind++) {
        static const char *const name[3] = {"lattice", "hexagonal", "settled"};
        sphpa_particles p;
        if (kind == 1 && dim == 1) continue; /* there is one lattice only */
        verify_gas_box(&p, dim, 0.0, 1.0, across[dim],
                       kind == 1 ? SPHPA_LATTICE_HEXAGONAL : SPHPA_LATTICE_CUBIC, 0.0);
        verify_cloud points = verify_cloud_of(&p, 0.0, 1.0);
        if (kind == 2) verify_cloud_settle(&points, 1.0 / across[dim]);
        verify_cloud_kernels(v, &points, name[kind]);
        verify_cloud_free(&points);
        sphpa_particles_free(&p);
    }
}

static void verify_interpolation1(verify *v) { verify_interpolation(v, 1); }
static void verify_interpolation2(verify *v) { verify_interpolation(v, 2); }
static void verify_interpolation3(verify *v) { verify_interpolation(v, 3); }

#endif
