/* Fragments against a union-find over all pairs, clouds of known content, and sums that must close.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sphpa.h"

#include "near.h"

/* a few roundings of a field in sphpa_real, of sums and products in double */
#define SUM_EPS 1e-12
#define NAN_D ((double)NAN)

static sphpa_particles cloud(int dim, size_t n, int damaged) {
    sphpa_particles p;
    size_t first;
    assert_int_equal(sphpa_particles_create(&p, dim, n, damaged ? SPHPA_F(D) : 0, 0, NULL, 0, NULL),
                     SPHPA_OK);
    assert_int_equal(sphpa_particles_add(&p, n, &first, NULL), SPHPA_OK);
    for (size_t i = 0; i < n; i++) p.m[i] = 1, p.h[i] = SPHPA_R(0.5), p.rho[i] = 1.0;
    return p;
}

/* random places in the unit cube, h over a decade, masses, velocities and energies at random */
static sphpa_particles random_cloud(int dim, size_t n, double h, uint64_t seed, int damaged) {
    sphpa_rng rng = sphpa_rng_seed(seed, 5);
    sphpa_particles p = cloud(dim, n, damaged);
    for (size_t i = 0; i < n; i++) {
        for (int a = 0; a < dim; a++) {
            p.x[3 * i + (size_t)a] = sphpa_rng_uniform(&rng);
            p.v[3 * i + (size_t)a] = (sphpa_real)sphpa_rng_normal(&rng);
        }
        p.m[i] = (sphpa_real)(0.5 + sphpa_rng_uniform(&rng));
        p.h[i] = (sphpa_real)(h * pow(10.0, sphpa_rng_uniform(&rng) - 0.5));
        p.u[i] = sphpa_rng_uniform(&rng);
        p.body[i] = (int32_t)sphpa_rng_below(&rng, 2);
        if (damaged) p.D[i] = (sphpa_real)sphpa_rng_uniform(&rng);
    }
    return p;
}

static sphpa_fragments find(const sphpa_particles *p, const sphpa_box *box,
                            const sphpa_fragment_options *options) {
    sphpa_fragments f;
    sphpa_error err;
    memset(&f, 0, sizeof f);
    sphpa_result result = sphpa_fragment_find(p, box, options, &f, &err);
    if (result != SPHPA_OK) print_error("%s\n", err.message);
    assert_int_equal(result, SPHPA_OK);
    assert_int_equal(f.n, p->n);
    return f;
}

static sphpa_fragment_options no_options(void) {
    sphpa_fragment_options options;
    memset(&options, 0, sizeof options);
    return options;
}

static sphpa_box unit_box(int x, int y, int z) {
    sphpa_box box;
    memset(&box, 0, sizeof box);
    for (int a = 0; a < 3; a++) box.high[a] = 1.0;
    box.periodic[0] = x, box.periodic[1] = y, box.periodic[2] = z;
    return box;
}

/* ---- an independent answer ------------------------------------------------------------------- */

/* Smallest member's id for every particle by relabelling over all pairs until nothing changes; -1
   dust, -2 not of the body. */
static int64_t *brute(const sphpa_particles *p, const sphpa_box *box, double link, double below,
                      int32_t body) {
    int64_t *name = (int64_t *)malloc(p->n * sizeof *name);
    assert_non_null(name);
    for (size_t i = 0; i < p->n; i++) {
        name[i] = p->id[i];
        if (p->D != NULL && below <= 1.0 && (double)p->D[i] >= below) name[i] = -1;
        if (body >= 0 && p->body[i] != body) name[i] = -2;
    }
    for (int changed = 1; changed;) {
        changed = 0;
        for (size_t i = 0; i < p->n; i++)
            for (size_t j = 0; j < p->n; j++) {
                if (name[i] < 0 || name[j] < 0 || name[i] <= name[j]) continue;
                double r2 = 0.0, reach = 0.5 * link * ((double)p->h[i] + (double)p->h[j]);
                for (int a = 0; a < p->dim; a++) {
                    double dx = fabs(p->x[3 * i + (size_t)a] - p->x[3 * j + (size_t)a]);
                    if (box != NULL && box->periodic[a] && dx > 0.5) dx = 1.0 - dx;
                    r2 += dx * dx;
                }
                if (r2 < reach * reach) name[i] = name[j], changed = 1;
            }
    }
    return name;
}

/* the fragments are those of brute(), sorted, and their sums those of their members */
static void check(const sphpa_particles *p, const sphpa_fragments *f, const int64_t *name) {
    size_t members = 0, dust = 0;
    for (size_t i = 0; i < p->n; i++) {
        assert_true(f->label[i] < (int32_t)f->count);
        if (f->label[i] < 0) assert_true(name[i] == f->label[i]);
        else assert_true(name[i] == f->list[f->label[i]].id);
        dust += f->label[i] == SPHPA_FRAGMENT_DUST;
        members += f->label[i] >= 0;
    }
    assert_int_equal(f->dust_count, dust);
    for (size_t g = 0; g < f->count; g++) {
        const sphpa_fragment *one = &f->list[g];
        double mass = 0.0, internal = 0.0, v[3] = {0.0, 0.0, 0.0};
        size_t count = 0;
        for (size_t i = 0; i < p->n; i++) {
            if (f->label[i] != (int32_t)g) continue;
            count++;
            mass += (double)p->m[i];
            internal += (double)p->m[i] * p->u[i];
            for (size_t a = 0; a < 3; a++) v[a] += (double)p->m[i] * (double)p->v[3 * i + a];
        }
        assert_int_equal(one->count, count);
        assert_near(one->mass, mass, SUM_EPS);
        assert_near(one->internal, internal, SUM_EPS);
        for (int a = 0; a < 3; a++) assert_near_abs(one->velocity[a] * mass, v[a], SUM_EPS * mass);
        members -= count;
        if (g == 0) continue;
        assert_true(one->mass < one[-1].mass ||
                    (one->mass == one[-1].mass && one->id > one[-1].id));
    }
    assert_int_equal(members, 0);
}

static void same_as_brute_force(void **state) {
    (void)state;
    static const double h[4] = {0.0, 0.0008, 0.013, 0.05};
    size_t several = 0;
    for (int dim = 1; dim <= 3; dim++)
        for (uint64_t seed = 0; seed < 6; seed++)
            for (int variant = 0; variant < 4; variant++) {
                sphpa_fragment_options options = no_options();
                sphpa_particles p = random_cloud(dim, 400, h[dim], seed, variant > 0);
                sphpa_box box = unit_box(1, seed % 2 == 0, 1);
                const sphpa_box *periodic = variant % 2 ? &box : NULL;
                double link = 2.0, below = 0.9;
                int32_t body = -1;
                if (variant == 2) {
                    link = 0.7 * 3.0, below = 0.4, body = 1;
                    options.link = 0.7, options.support = 3.0, options.damage_below = below;
                    options.one_body = 1, options.body = body;
                }
                sphpa_fragments f = find(&p, periodic, variant == 2 ? &options : NULL);
                int64_t *name = brute(&p, periodic, link, below, body);
                check(&p, &f, name);
                several += f.count > 10 && f.list[0].count > 5;
                free(name);
                sphpa_fragment_free(&f);
                sphpa_particles_free(&p);
            }
    assert_true(several > 40); /* of 72: the clouds are neither dust nor one lump */
}

/* ---- what is linked -------------------------------------------------------------------------- */

static void links_end_at_the_linking_length(void **state) {
    (void)state;
    sphpa_particles p = cloud(3, 20, 0); /* h = 1/2, support 1: linked below a distance of 1 */
    for (int far = 0; far < 3; far++) {
        double step = far == 0 ? 1.0 - 1e-9 : far == 1 ? 1.0 : 1.0 + 1e-9;
        for (size_t i = 0; i < p.n; i++) p.x[3 * i + 1] = (double)i * step;
        sphpa_fragments f = find(&p, NULL, NULL);
        assert_int_equal(f.count, far == 0 ? 1 : 20);
        assert_near(sphpa_fragment_largest(&f, 0.0), far == 0 ? 1.0 : 0.05, 1e-15);
        sphpa_fragment_free(&f);
    }
    sphpa_fragment_options options = no_options();
    for (int k = 0; k < 2; k++) { /* link and support both scale it */
        double *scale = k == 0 ? &options.link : &options.support, unit = k == 0 ? 1.0 : 2.0;
        *scale = 1.5 * unit;
        for (size_t i = 0; i < p.n; i++) p.x[3 * i + 1] = 1.49 * (double)i;
        sphpa_fragments f = find(&p, NULL, &options);
        assert_int_equal(f.count, 1);
        assert_near(f.options.link * f.options.support, 3.0, 1e-15);
        sphpa_fragment_free(&f);
        *scale = 1.48 * unit;
        f = find(&p, NULL, &options);
        assert_int_equal(f.count, 20);
        sphpa_fragment_free(&f);
        *scale = 0.0;
    }
    sphpa_particles_free(&p);
}

/* a coarse and a fine particle: half the sum of both linking lengths decides */
static void unequal_supports_link_by_their_mean(void **state) {
    (void)state;
    sphpa_particles p = cloud(3, 2, 0);
    p.h[0] = SPHPA_R(0.125), p.h[1] = SPHPA_R(1.0); /* (0.25 + 2)/2 = 1.125 */
    for (int far = 0; far < 2; far++) {
        p.x[3] = far ? 1.126 : 1.124;
        sphpa_fragments f = find(&p, NULL, NULL);
        assert_int_equal(f.count, 1 + far);
        sphpa_fragment_free(&f);
    }
    sphpa_particles_free(&p);
}

/* a bar of particles between two balls: whole it bridges them, damaged it does not */
static void dust_bridges_nothing(void **state) {
    (void)state;
    sphpa_particles p = cloud(3, 30, 1);
    for (size_t i = 0; i < p.n; i++) p.x[3 * i] = 0.8 * (double)i, p.v[3 * i] = (sphpa_real)i;
    for (int broken = 0; broken < 2; broken++) {
        for (size_t i = 12; i < 15; i++) p.D[i] = broken ? SPHPA_R(0.9001) : SPHPA_R(0.8999);
        sphpa_fragments f = find(&p, NULL, NULL);
        assert_int_equal(f.count, broken ? 2 : 1);
        if (broken) {
            assert_int_equal(f.list[0].count, 15);
            assert_int_equal(f.list[0].id, 15);
            assert_int_equal(f.list[1].count, 12);
            assert_int_equal(f.label[13], SPHPA_FRAGMENT_DUST);
            assert_true(f.dust == 3.0 && f.dust_momentum[0] == 12.0 + 13.0 + 14.0);
            assert_true(f.mass == 30.0 && sphpa_fragment_largest(&f, 0.0) == 0.5);
            assert_true(sphpa_fragment_largest(&f, 60.0) == 0.25);
        }
        sphpa_fragment_free(&f);
    }
    for (size_t i = 0; i < p.n; i++) p.D[i] = 1; /* all dust: an answer, not an error */
    sphpa_fragments f = find(&p, NULL, NULL);
    assert_true(f.count == 0 && f.dust == 30.0 && f.mass == 30.0 && f.dust_count == 30);
    assert_true(sphpa_fragment_largest(&f, 0.0) == 0.0);
    assert_int_equal(sphpa_fragment_cumulative(&f, NULL, NULL), 0);
    sphpa_fragment_free(&f);
    static const double none[2] = {-1.0, 1.5}; /* nobody is dust */
    for (int k = 0; k < 2; k++) {
        sphpa_fragment_options options = no_options();
        options.damage_below = none[k];
        f = find(&p, NULL, &options);
        assert_true(f.count == 1 && f.dust_count == 0 && f.list[0].count == 30);
        sphpa_fragment_free(&f);
    }
    sphpa_fragment_options whole = no_options();
    whole.damage_below = 1.0; /* D = 1 is dust even so */
    f = find(&p, NULL, &whole);
    assert_int_equal(f.count, 0);
    sphpa_fragment_free(&f);
    sphpa_particles_free(&p);
}

static void one_body_alone(void **state) {
    (void)state;
    sphpa_particles p = cloud(2, 10, 0);
    for (size_t i = 0; i < p.n; i++) p.x[3 * i + 1] = 0.9 * (double)i, p.body[i] = i == 4 ? 3 : 0;
    sphpa_fragments f = find(&p, NULL, NULL);
    assert_int_equal(f.count, 1);
    sphpa_fragment_free(&f);
    sphpa_fragment_options options = no_options();
    options.one_body = 1; /* body 0 */
    f = find(&p, NULL, &options);
    assert_true(f.count == 2 && f.mass == 9.0 && f.dust_count == 0);
    assert_true(f.list[0].count == 5 && f.list[0].id == 5 && f.list[1].count == 4);
    assert_int_equal(f.label[4], SPHPA_FRAGMENT_OTHER);
    sphpa_fragment_free(&f);
    sphpa_particles_free(&p);
}

/* a row of ten with one ghost: it bridges nothing, weighs nothing and belongs to none */
static void ghosts_are_in_no_fragment(void **state) {
    (void)state;
    sphpa_particles p;
    const sphpa_mask fields = SPHPA_F(ghost) | SPHPA_F(D);
    assert_int_equal(sphpa_particles_create(&p, 2, 10, fields, 0, NULL, 0, NULL), SPHPA_OK);
    assert_int_equal(sphpa_particles_add(&p, 10, NULL, NULL), SPHPA_OK);
    for (size_t i = 0; i < p.n; i++) {
        p.m[i] = 1, p.h[i] = SPHPA_R(0.5), p.rho[i] = 1.0;
        p.x[3 * i + 1] = 0.9 * (double)i, p.v[3 * i] = 1;
    }
    p.ghost[4] = 2, p.D[4] = 1; /* nor is it dust */
    sphpa_fragments f = find(&p, NULL, NULL);
    assert_true(f.count == 2 && f.mass == 9.0 && f.dust_count == 0 && f.dust == 0.0);
    assert_true(f.list[0].count == 5 && f.list[0].id == 5 && f.list[1].count == 4);
    assert_int_equal(f.label[4], SPHPA_FRAGMENT_OTHER);
    sphpa_fragment_free(&f);
    p.D[4] = 0;
    f = find(&p, NULL, NULL);
    assert_true(f.count == 2 && f.mass == 9.0 && f.label[4] == SPHPA_FRAGMENT_OTHER);
    sphpa_fragment_free(&f);
    for (size_t i = 0; i < p.n; i++) p.ghost[i] = 1;
    sphpa_error err;
    memset(&err, 0, sizeof err);
    assert_int_equal(sphpa_fragment_find(&p, NULL, NULL, &f, &err), SPHPA_ERROR_EMPTY);
    assert_non_null(strstr(err.message, "ghosts"));
    sphpa_particles_free(&p);
}

static void one_particle_is_a_fragment(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++) {
        sphpa_particles p = cloud(dim, 1, 0);
        p.x[0] = 3.5, p.v[0] = -2, p.u[0] = 4.0, p.m[0] = SPHPA_R(0.25);
        sphpa_fragments f = find(&p, NULL, NULL);
        assert_true(f.count == 1 && f.label[0] == 0 && f.list[0].count == 1 && f.list[0].id == 0);
        assert_true(f.list[0].mass == 0.25 && f.list[0].internal == 1.0 && f.mass == 0.25);
        assert_true(f.list[0].centre[0] == 3.5 && f.list[0].velocity[0] == -2.0);
        assert_true(f.list[0].angular[2] == 0.0);
        sphpa_fragment_free(&f);
        sphpa_particles_free(&p);
    }
}

/* ---- sums ------------------------------------------------------------------------------------ */

/* two balls of points that turn about their centres, far from the origin */
static void two_balls(void **state) {
    (void)state;
    static const double centre[2][3] = {{1e3, -2e3, 5e2}, {1e3 + 40.0, -2e3, 5e2}};
    static const double v[2][3] = {{1.0, 2.0, 3.0}, {-10.0, 0.0, 5.0}};
    static const double spin[2][3] = {{0.0, 0.0, 0.5}, {0.25, -1.0, 0.5}};
    static const int size[2] = {3, 5};
    size_t counts[2] = {0, 0};
    sphpa_particles p = cloud(3, 1000, 0);
    double inertia[2] = {0.0, 0.0}; /* cubes of (2 size + 1)^3 points: the same about every axis */
    p.n = 0;
    for (int b = 0; b < 2; b++)
        for (int i = -size[b]; i <= size[b]; i++)
            for (int j = -size[b]; j <= size[b]; j++)
                for (int k = -size[b]; k <= size[b]; k++) {
                    const double r[3] = {0.5 * i, 0.5 * j, 0.5 * k};
                    size_t at = 0;
                    if (p.n == p.capacity) {
                        assert_int_equal(sphpa_particles_reserve(&p, 2 * p.n, NULL), SPHPA_OK);
                    }
                    assert_int_equal(sphpa_particles_add(&p, 1, &at, NULL), SPHPA_OK);
                    p.m[at] = SPHPA_R(2.0), p.h[at] = SPHPA_R(0.5), p.u[at] = b + 1.0;
                    for (int a = 0; a < 3; a++) {
                        int c = (a + 1) % 3, d = (a + 2) % 3;
                        p.x[3 * at + (size_t)a] = centre[b][a] + r[a];
                        p.v[3 * at + (size_t)a] =
                            (sphpa_real)(v[b][a] + spin[b][c] * r[d] - spin[b][d] * r[c]);
                    }
                    inertia[b] += 2.0 * (r[0] * r[0] + r[1] * r[1]);
                    counts[b]++;
                }
    sphpa_fragments f = find(&p, NULL, NULL);
    assert_int_equal(f.count, 2);
    for (int g = 0; g < 2; g++) {
        int b = 1 - g; /* the larger one comes first */
        const sphpa_fragment *one = &f.list[g];
        assert_int_equal(one->count, counts[b]);
        assert_near(one->mass, 2.0 * (double)counts[b], 1e-15);
        assert_near(one->internal, 2.0 * (double)counts[b] * (b + 1.0), 1e-15);
        for (int a = 0; a < 3; a++) {
            assert_near(one->centre[a], centre[b][a], 1e-15);
            assert_near_abs(one->velocity[a], v[b][a], 1e-13);
            assert_near_abs(one->angular[a], inertia[b] * spin[b][a], 1e-11 * inertia[b]);
        }
    }
    sphpa_fragment_free(&f);
    sphpa_particles_free(&p);
}

static void sums_are_the_totals(void **state) {
    (void)state;
    for (int dim = 1; dim <= 3; dim++) {
        static const double h[4] = {0.0, 0.0004, 0.01, 0.04};
        sphpa_particles p = random_cloud(dim, 3000, h[dim] * pow(7.5, -1.0 / dim), 9, 1);
        for (size_t i = 0; i < p.n; i += 5) p.u[i] = -0.5 * p.u[i]; /* u may be a little below 0 */
        sphpa_fragments f = find(&p, NULL, NULL);
        double mass = 0.0, found = f.dust, P[3] = {0, 0, 0}, Q[3], L = 0.0, M = 0.0, energy = 0.0;
        memcpy(Q, f.dust_momentum, sizeof Q);
        for (size_t i = 0; i < p.n; i++) {
            double m = (double)p.m[i];
            mass += m;
            if (f.label[i] >= 0) energy += m * p.u[i];
            for (size_t a = 0; a < 3; a++) P[a] += m * (double)p.v[3 * i + a];
            if (f.label[i] >= 0)
                L +=
                    m * (p.x[3 * i] * (double)p.v[3 * i + 1] - p.x[3 * i + 1] * (double)p.v[3 * i]);
        }
        for (size_t g = 0; g < f.count; g++) {
            const sphpa_fragment *one = &f.list[g];
            found += one->mass;
            energy -= one->internal;
            M += one->angular[2] + one->mass * (one->centre[0] * one->velocity[1] -
                                                one->centre[1] * one->velocity[0]);
            for (int a = 0; a < 3; a++) Q[a] += one->mass * one->velocity[a];
        }
        assert_true(f.count > 100 && f.dust_count > 100 && f.list[0].count > 3);
        assert_near(found, mass, 1e-13);
        assert_near(f.mass, mass, 1e-13);
        assert_near_abs(energy, 0.0, 1e-13 * mass);
        assert_near_abs(L, M, 1e-13 * mass);
        for (int a = 0; a < 3; a++) assert_near_abs(P[a], Q[a], 1e-13 * mass);
        sphpa_fragment_free(&f);
        sphpa_particles_free(&p);
    }
}

/* the same rotating lump in the middle of the box and across its faces, edges and corners */
static void fragments_go_through_periodic_faces(void **state) {
    (void)state;
    sphpa_particles p = cloud(3, 300, 0);
    sphpa_rng rng = sphpa_rng_seed(3, 3);
    double r[900], spin[3] = {0.0, 0.0, 0.0}, mean[3] = {0.0, 0.0, 0.0};
    for (size_t k = 0; k < 900; k++)
        r[k] = 0.6 * (sphpa_rng_uniform(&rng) - 0.5); /* of a box of 2 */
    for (size_t k = 0; k < 900; k++) mean[k % 3] += r[k] / 300.0;
    for (size_t i = 0; i < p.n; i++) {
        for (size_t a = 0; a < 3; a++) r[3 * i + a] -= mean[a];
        p.h[i] = SPHPA_R(0.1);
        p.v[3 * i] = (sphpa_real)(-r[3 * i + 1]), p.v[3 * i + 1] = (sphpa_real)r[3 * i];
    }
    for (int corner = 0; corner < 8; corner++) {
        sphpa_box box = unit_box(1, 1, 1);
        const double shift[3] = {corner & 1 ? -0.93 : 0.1, corner & 2 ? 0.99 : 0.0,
                                 corner & 4 ? 0.88 : -0.2};
        for (int a = 0; a < 3; a++) box.low[a] = -1.0;
        for (size_t k = 0; k < 900; k++) {
            double x = r[k] + shift[k % 3];
            p.x[k] = x < -1.0 ? x + 2.0 : x >= 1.0 ? x - 2.0 : x;
        }
        sphpa_fragments f = find(&p, &box, NULL);
        assert_int_equal(f.count, 1);
        for (int a = 0; a < 3; a++) {
            assert_near_abs(f.list[0].centre[a], shift[a], 1e-14);
            if (corner == 0) spin[a] = f.list[0].angular[a];
            assert_near_abs(f.list[0].angular[a], spin[a], 1e-12);
        }
        sphpa_fragment_free(&f);
        f = find(&p, NULL, NULL); /* in open space it is cut */
        assert_true(corner == 0 ? f.count == 1 : f.count > 1);
        sphpa_fragment_free(&f);
    }
    assert_true(spin[2] > 1.0);
    sphpa_particles_free(&p);
}

/* a chain of nearly half the box, named from one end: the first particle is no hint of the centre
 */
static void long_fragments_have_their_centre(void **state) {
    (void)state;
    sphpa_particles p = cloud(1, 49, 0);
    sphpa_box box = unit_box(1, 0, 0);
    for (int backward = 0; backward < 2; backward++)
        for (int shift = 0; shift < 10; shift++) {
            double first = 0.1 * shift + 0.003, want = first + 0.24;
            for (size_t i = 0; i < p.n; i++) {
                double x = first + 0.01 * (double)(backward ? p.n - 1 - i : i);
                p.x[3 * i] = x < 1.0 ? x : x - 1.0;
                p.h[i] = SPHPA_R(0.01);
            }
            sphpa_fragments f = find(&p, &box, NULL);
            assert_int_equal(f.count, 1);
            assert_near_abs(f.list[0].centre[0], want < 1.0 ? want : want - 1.0, 1e-14);
            sphpa_fragment_free(&f);
        }
    sphpa_particles_free(&p);
}

static void centres_stay_inside_the_box(void **state) {
    (void)state;
    sphpa_particles p = cloud(1, 2, 0);
    sphpa_box box = unit_box(1, 0, 0);
    p.h[0] = p.h[1] = SPHPA_R(0.1);
    for (int k = 0; k < 400; k++) { /* a pair whose middle is at or next to the face */
        double nudge = (k - 200) * 1e-17;
        p.x[0] = 0.05 + nudge, p.x[3] = 0.95;
        sphpa_fragments f = find(&p, &box, NULL);
        assert_int_equal(f.count, 1);
        double x = f.list[0].centre[0];
        assert_true(x >= 0.0 && x < 1.0);
        assert_near_abs(x < 0.5 ? x : x - 1.0, 0.0, 1e-15);
        sphpa_fragment_free(&f);
    }
    sphpa_particles_free(&p);
}

/* ---- order ----------------------------------------------------------------------------------- */

static void order_does_not_matter(void **state) {
    (void)state;
    for (int dim = 2; dim <= 3; dim++)
        for (int periodic = 0; periodic < 2; periodic++) {
            sphpa_particles p = random_cloud(dim, 2000, dim == 2 ? 0.005 : 0.025, 4, 1);
            sphpa_box box = unit_box(1, 1, 1);
            for (size_t i = 0; i < p.n; i++) p.m[i] = 1; /* so that masses tie */
            sphpa_fragments f = find(&p, periodic ? &box : NULL, NULL);
            int32_t *label = (int32_t *)malloc(p.n * sizeof *label); /* by id */
            uint32_t *order = (uint32_t *)malloc(p.n * sizeof *order);
            assert_true(label != NULL && order != NULL);
            for (size_t i = 0; i < p.n; i++) label[p.id[i]] = f.label[i];
            sphpa_rng rng = sphpa_rng_seed(8, 8);
            for (int trial = 0; trial < 4; trial++) {
                for (uint32_t i = 0; i < p.n; i++) order[i] = i;
                for (uint32_t i = (uint32_t)p.n; i-- > 1;) {
                    uint32_t j = sphpa_rng_below(&rng, i + 1), swap = order[i];
                    order[i] = order[j], order[j] = swap;
                }
                assert_int_equal(sphpa_particles_permute(&p, order, NULL), SPHPA_OK);
                sphpa_fragments g = find(&p, periodic ? &box : NULL, NULL);
                assert_int_equal(g.count, f.count);
                assert_memory_equal(g.list, f.list, f.count * sizeof *f.list);
                assert_memory_equal(&g.dust, &f.dust, sizeof f.dust);
                assert_memory_equal(g.dust_momentum, f.dust_momentum, sizeof f.dust_momentum);
                for (size_t i = 0; i < p.n; i++) assert_int_equal(g.label[i], label[p.id[i]]);
                sphpa_fragment_free(&g);
            }
            free(label);
            free(order);
            sphpa_fragment_free(&f);
            sphpa_particles_free(&p);
        }
}

static void spectrum_counts_from_the_top(void **state) {
    (void)state;
    static const size_t sizes[6] = {7, 3, 3, 3, 1, 1}; /* chains, far from each other */
    static const double want_mass[3] = {7.0, 3.0, 1.0};
    static const size_t want_number[3] = {1, 4, 6};
    sphpa_particles p = cloud(3, 18, 0);
    size_t at = 18;
    for (int k = 0; k < 6; k++)
        for (size_t i = 0; i < sizes[k]; i++) {
            at--; /* the large ones have the large ids */
            p.x[3 * at] = 0.5 * (double)i, p.x[3 * at + 1] = 100.0 * k;
        }
    sphpa_fragments f = find(&p, NULL, NULL);
    double mass[6];
    size_t number[6];
    assert_int_equal(f.count, 6);
    for (int k = 1; k < 3; k++) assert_true(f.list[k].id < f.list[k + 1].id); /* among the threes */
    assert_int_equal(sphpa_fragment_cumulative(&f, mass, number), 3);
    for (int k = 0; k < 3; k++) assert_true(mass[k] == want_mass[k] && number[k] == want_number[k]);
    assert_int_equal(sphpa_fragment_cumulative(&f, NULL, NULL), 3);
    assert_near(sphpa_fragment_largest(&f, 0.0), 7.0 / 18.0, 1e-15);
    sphpa_fragment_free(&f);
    sphpa_particles_free(&p);

    p = random_cloud(3, 2000, 0.02, 12, 1);
    f = find(&p, NULL, NULL);
    double *m = (double *)malloc(f.count * sizeof *m);
    size_t *n = (size_t *)malloc(f.count * sizeof *n);
    assert_true(m != NULL && n != NULL);
    size_t entries = sphpa_fragment_cumulative(&f, m, n);
    for (size_t k = 0; k < entries; k++) {
        size_t count = 0;
        for (size_t g = 0; g < f.count; g++) count += f.list[g].mass >= m[k];
        assert_int_equal(count, n[k]);
        assert_true(k == 0 || (m[k] < m[k - 1] && n[k] > n[k - 1]));
    }
    assert_int_equal(n[entries - 1], f.count);
    free(m);
    free(n);
    sphpa_fragment_free(&f);
    sphpa_particles_free(&p);
    assert_int_equal(sphpa_fragment_cumulative(NULL, NULL, NULL), 0);
    assert_true(sphpa_fragment_largest(NULL, 1.0) == 0.0);
}

/* ---- errors ---------------------------------------------------------------------------------- */

static void refuse(const sphpa_particles *p, const sphpa_box *box,
                   const sphpa_fragment_options *options, sphpa_fragments *out, sphpa_result want,
                   const char *word) {
    sphpa_error err;
    sphpa_fragments before = *out;
    sphpa_result result = sphpa_fragment_find(p, box, options, out, &err);
    if (result != want || strstr(err.message, word) == NULL)
        print_error("wanted \"%s\", got: %s\n", word, result == SPHPA_OK ? "OK" : err.message);
    assert_int_equal(result, want);
    assert_non_null(strstr(err.message, word));
    assert_memory_equal(out, &before, sizeof before); /* as it was */
    assert_int_equal(sphpa_fragment_find(p, box, options, out, NULL), want);
}

static void bad_options_are_refused(void **state) {
    (void)state;
    static const double values[6] = {-1.0, NAN_D, HUGE_VAL, -1e-9, NAN_D, HUGE_VAL};
    sphpa_particles p = random_cloud(3, 50, 0.05, 1, 1);
    sphpa_fragments f = find(&p, NULL, NULL);
    for (int k = 0; k < 6; k++) {
        sphpa_fragment_options options = no_options();
        *(k < 3 ? &options.link : &options.support) = values[k];
        refuse(&p, NULL, &options, &f, k % 3 ? SPHPA_ERROR_NOT_FINITE : SPHPA_ERROR_NEGATIVE,
               k < 3 ? "link is" : "support is");
    }
    sphpa_fragment_options options = no_options();
    options.damage_below = NAN_D;
    refuse(&p, NULL, &options, &f, SPHPA_ERROR_NOT_FINITE, "damage_below");
    options = no_options();
    options.one_body = 1, options.body = 5;
    refuse(&p, NULL, &options, &f, SPHPA_ERROR_EMPTY, "body 5");
    sphpa_box box = unit_box(1, 0, 0);
    options = no_options();
    options.link = 30.0;
    refuse(&p, &box, &options, &f, SPHPA_ERROR_RANGE, "half of the periodic box");
    p.x[3 * 7] = 1.5;
    refuse(&p, &box, NULL, &f, SPHPA_ERROR_OUTSIDE, "7");
    box.high[0] = -1.0;
    refuse(&p, &box, NULL, &f, SPHPA_ERROR_RANGE, "box");
    assert_int_equal(sphpa_fragment_find(NULL, NULL, NULL, &f, NULL), SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_fragment_find(&p, NULL, NULL, NULL, NULL), SPHPA_ERROR_MISSING);
    sphpa_fragment_free(&f);
    assert_true(f.label == NULL && f.list == NULL && f.count == 0);
    sphpa_fragment_free(&f); /* twice is fine, and NULL too */
    sphpa_fragment_free(NULL);
    sphpa_particles_free(&p);
    refuse(&p, NULL, NULL, &f, SPHPA_ERROR_EMPTY, "no particles");
}

static void bad_particles_are_refused(void **state) {
    (void)state;
    sphpa_particles p = random_cloud(3, 50, 0.05, 1, 1);
    sphpa_fragments f = find(&p, NULL, NULL);
    sphpa_real *const fields[5] = {p.m + 7, p.h + 7, p.v + 3 * 7 + 1, p.D + 7, p.m + 7};
    static const double values[5] = {NAN_D, HUGE_VAL, NAN_D, NAN_D, -2.0};
    static const char *const words[5] = {"m of particle 7", "h of particle 7", "v of particle 7",
                                         "D of particle 7", "is -2"};
    for (int k = 0; k < 5; k++) {
        sphpa_real kept = *fields[k];
        *fields[k] = (sphpa_real)values[k];
        refuse(&p, NULL, NULL, &f, k < 4 ? SPHPA_ERROR_NOT_FINITE : SPHPA_ERROR_NEGATIVE, words[k]);
        *fields[k] = kept;
    }
    p.h[7] = 0;
    refuse(&p, NULL, NULL, &f, SPHPA_ERROR_NEGATIVE, "h of particle 7");
    p.h[7] = 1;
    p.u[7] = NAN_D;
    refuse(&p, NULL, NULL, &f, SPHPA_ERROR_NOT_FINITE, "u of particle 7");
    p.u[7] = 0.0;
    p.x[3 * 7 + 2] = NAN_D;
    refuse(&p, NULL, NULL, &f, SPHPA_ERROR_NOT_FINITE, "7");
    p.x[3 * 7 + 2] = 0.0;
    assert_int_equal(sphpa_fragment_find(&p, NULL, NULL, &f, NULL), SPHPA_OK); /* replaces f */
    sphpa_fragment_free(&f);
    sphpa_particles_free(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_as_brute_force),
        cmocka_unit_test(links_end_at_the_linking_length),
        cmocka_unit_test(unequal_supports_link_by_their_mean),
        cmocka_unit_test(dust_bridges_nothing),
        cmocka_unit_test(one_body_alone),
        cmocka_unit_test(ghosts_are_in_no_fragment),
        cmocka_unit_test(one_particle_is_a_fragment),
        cmocka_unit_test(two_balls),
        cmocka_unit_test(sums_are_the_totals),
        cmocka_unit_test(fragments_go_through_periodic_faces),
        cmocka_unit_test(long_fragments_have_their_centre),
        cmocka_unit_test(centres_stay_inside_the_box),
        cmocka_unit_test(order_does_not_matter),
        cmocka_unit_test(spectrum_counts_from_the_top),
        cmocka_unit_test(bad_options_are_refused),
        cmocka_unit_test(bad_particles_are_refused),
    };
    return cmocka_run_group_tests_name("fragments", tests, NULL, NULL);
}
