/* test_snapshot.c: the layout against the library's own reader, round trips and restarts bit by
   bit, and every way in which a file can be missing, broken, foreign or too large for the disk. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#define SPHPA_GODUNOV_IMPLEMENTATION
#define SPHPA_EDGES_IMPLEMENTATION
#define SPHPA_SNAPSHOT_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

#include <hdf5.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- a small gas, and a module of a user's own ----------------------------------------------- */

/* A module with a column of two numbers, which it advances, and a history that it keeps. */
typedef struct dye {
    double *history; /* (count) [s] every step's time */
    size_t count;
    int refuse; /* not 0: rejects what a checkpoint gives back */
    int more;   /* not 0: wants one field more */
} dye;

static sphpa_result dye_commit(sphpa_sim *sim, void *params, size_t first, size_t last,
                               size_t *bad) {
    (void)params;
    (void)bad;
    double *colour = sphpa_particles_column(&sim->p, "Dye");
    for (size_t i = first; i < last; i++) {
        colour[2 * i] += sim->dt * sim->p.u[i];
        colour[2 * i + 1] = 0.5 * colour[2 * i + 1] + 1e-3 * sim->p.rho[i];
    }
    return SPHPA_OK;
}

/* its turn comes once a step, in one thread */
static sphpa_result dye_history(sphpa_sim *sim, void *params, size_t first, size_t last,
                                size_t *bad) {
    dye *d = (dye *)params;
    (void)first;
    (void)last;
    (void)bad;
    double *grown = (double *)realloc(d->history, (d->count + 1) * sizeof(double));
    if (grown == NULL) return SPHPA_ERROR_MEMORY;
    d->history = grown;
    d->history[d->count++] = sim->time;
    return SPHPA_OK;
}

static sphpa_result dye_keep(sphpa_sim *sim, void *params, sphpa_keep_fn exchange, void *user,
                             sphpa_error *err) {
    dye *d = (dye *)params;
    (void)sim;
    void *data = d->history, *nothing = NULL;
    size_t bytes = d->count * sizeof(double), none = 0;
    sphpa_result result = exchange(user, "history", &data, &bytes, err);
    if (result == SPHPA_OK) result = exchange(user, "nothing", &nothing, &none, err);
    if (result != SPHPA_OK) return result;
    assert_int_equal(none, 0);
    free(nothing);
    if (data == (void *)d->history) return SPHPA_OK;
    free(d->history);
    d->history = (double *)data;
    d->count = bytes / sizeof(double);
    if (!d->refuse) return SPHPA_OK;
    d->refuse = 0;
    return sphpa_error_set(err, SPHPA_ERROR_RANGE, "the dye does not like its history");
}

static sphpa_module dye_module(dye *d) {
    sphpa_module module;
    memset(&module, 0, sizeof module);
    module.name = "dye";
    module.params = d;
    module.keep = dye_keep;
    module.passes = 2;
    module.pass[0].name = "dye grows";
    module.pass[0].stage = SPHPA_STAGE_COMMIT;
    module.pass[0].reads = SPHPA_F(u) | SPHPA_F(rho) | SPHPA_F(S) | SPHPA_F(C);
    if (d->more) module.pass[0].reads |= SPHPA_F(D);
    module.pass[0].particle = dye_commit;
    module.pass[1].name = "dye history";
    module.pass[1].stage = SPHPA_STAGE_RESIZE;
    module.pass[1].particle = dye_history;
    module.columns = 1;
    strcpy(module.column[0].name, "Dye");
    module.column[0].components = 2;
    module.column[0].length = 2;
    module.column[0].time = -1;
    return module;
}

/* One whole scene with its parameters. */
typedef struct world {
    sphpa_ideal gas;
    sphpa_eos eos;
    sphpa_gas_params params;
    sphpa_godunov_params godunov; /* for schemes 1 to 3; 0 is the gas */
    int scheme;
    sphpa_edges_params edges;
    dye colour;
    sphpa_sim_options options;
    int dim, cells, plain; /* plain: without the user's module */
    int edged;             /* not 0: with edges */
    sphpa_sim sim;
} world;

/* a wavy gas in a box, n^dim particles in random places near a lattice */
static void world_particles(const world *w, sphpa_particles *p) {
    size_t total = 1, first = 0, n = (size_t)w->cells;
    for (int a = 0; a < w->dim; a++) total *= n;
    sphpa_rng rng = sphpa_rng_seed(7, 1);
    sphpa_error err;
    assert_int_equal(sphpa_particles_create(p, w->dim, 0, 0, 0, NULL, 0, &err), SPHPA_OK);
    assert_int_equal(sphpa_particles_add(p, total, &first, &err), SPHPA_OK);
    double d = 2.0 / (double)n;
    for (size_t i = 0; i < total; i++) {
        size_t rest = i;
        for (int a = 0; a < w->dim; a++, rest /= n)
            p->x[3 * i + (size_t)a] =
                -1.0 + d * ((double)(rest % n) + 0.5 + 0.2 * (sphpa_rng_uniform(&rng) - 0.5));
        p->v[3 * i] = SPHPA_R(0.3) * (sphpa_real)sin(3.0 * p->x[3 * i]);
        p->m[i] = (sphpa_real)pow(d, w->dim);
        p->h[i] = (sphpa_real)(1.2 * d);
        p->rho[i] = 1.0;
        p->u[i] = p->x[3 * i] < 0.0 ? 2.5 : 1.0;
        p->body[i] = p->x[3 * i] < 0.0 ? 1 : 2;
    }
}

static void world_make(world *w) {
    sphpa_error err;
    sphpa_particles p;
    sphpa_scene scene;
    memset(&scene, 0, sizeof scene);
    w->gas.gamma = 1.4;
    w->eos = sphpa_ideal_eos(&w->gas);
    w->params.eos = &w->eos;
    w->params.materials = 1;
    w->godunov.gas = w->params;
    w->godunov.g1 = w->scheme == 3 ? 0.0 : 0.2;
    sphpa_module module = w->scheme == 1   ? sphpa_godunov(&w->godunov)
                          : w->scheme == 2 ? sphpa_godunov_adke(&w->godunov)
                          : w->scheme == 3 ? sphpa_godunov_mpm(&w->godunov)
                                           : sphpa_gas(&w->params);
    assert_int_equal(sphpa_scene_add(&scene, module), SPHPA_OK);
    if (!w->plain) assert_int_equal(sphpa_scene_add(&scene, dye_module(&w->colour)), SPHPA_OK);
    if (w->edged) assert_int_equal(sphpa_scene_add(&scene, sphpa_edges(&w->edges)), SPHPA_OK);
    world_particles(w, &p);
    sphpa_result result = sphpa_sim_create(&w->sim, &scene, &p, &w->options, &err);
    if (result != SPHPA_OK) print_error("%s\n", err.message);
    assert_int_equal(result, SPHPA_OK);
    sphpa_particles_free(&p);
}

/* zeroed members are the defaults: a periodic square of 14^2 particles */
static world *world_new(int dim, int cells) {
    world *w = (world *)calloc(1, sizeof(world));
    assert_non_null(w);
    w->dim = dim;
    w->cells = cells;
    for (int a = 0; a < dim; a++) {
        w->options.box.periodic[a] = 1;
        w->options.box.low[a] = -1.0;
        w->options.box.high[a] = 1.0;
    }
    return w;
}

static void world_free(world *w) {
    sphpa_sim_free(&w->sim);
    free(w->colour.history);
    free(w);
}

static void steps(sphpa_sim *sim, int count) {
    sphpa_error err;
    for (int k = 0; k < count; k++) {
        sphpa_result result = sphpa_sim_step(sim, HUGE_VAL, &err);
        if (result != SPHPA_OK) print_error("%s\n", err.message);
        assert_int_equal(result, SPHPA_OK);
    }
}

/* every field and column (not the copies at the step's start), the clock and the counts */
static void assert_same_bits(const sphpa_sim *a, const sphpa_sim *b) {
    assert_true(a->p.n == b->p.n && a->p.fields == b->p.fields && a->p.columns == b->p.columns);
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        if (((a->p.fields >> k) & 1u) == 0) continue;
        sphpa_field_info info = sphpa_field_describe((sphpa_field)k);
        if (memcmp(sphpa_particles_data(&a->p, (sphpa_field)k, 0),
                   sphpa_particles_data(&b->p, (sphpa_field)k, 0), a->p.n * info.bytes) != 0)
            fail_msg("%s differs", info.name);
    }
    for (int k = 0; k < a->p.columns; k++)
        assert_memory_equal(a->p.column[k].data, b->p.column[k].data,
                            a->p.n * (size_t)a->p.column[k].components * sizeof(double));
    const double clock_a[] = {a->time, a->dt, a->dt_next, a->dt_first, a->dt_free};
    const double clock_b[] = {b->time, b->dt, b->dt_next, b->dt_first, b->dt_free};
    assert_memory_equal(clock_a, clock_b, sizeof clock_a);
    assert_int_equal(a->started, b->started);
    assert_int_equal(a->p.next_id, b->p.next_id);
    const sphpa_stats *s = &a->stats, *t = &b->stats;
    assert_int_equal(s->steps, t->steps);
    assert_int_equal(s->evaluations, t->evaluations);
    assert_int_equal(s->rebuilds, t->rebuilds);
    assert_int_equal(s->u_below, t->u_below);
    assert_int_equal(s->limit_last, t->limit_last);
    assert_int_equal(s->limit_id, t->limit_id);
    assert_int_equal(s->u_id, t->u_id);
    assert_memory_equal(&s->u_deficit, &t->u_deficit, sizeof(double));
    assert_memory_equal(&s->u_least, &t->u_least, sizeof(double));
    assert_memory_equal(&s->neighbours_mean, &t->neighbours_mean, sizeof(double));
    for (int k = 0; k < s->limits; k++) assert_int_equal(s->limit[k].steps, t->limit[k].steps);
    for (int k = 0; k < s->timings; k++) assert_int_equal(s->timing[k].calls, t->timing[k].calls);
}

/* ---- files ----------------------------------------------------------------------------------- */

static char directory[] = "/tmp/sphpa_test_snapshot_XXXXXX";
static char path_text[8][200];

/* the path of a file of that name in the test's directory; eight are valid at a time */
static const char *at(const char *name) {
    static int turn = 0;
    turn = (turn + 1) % 8;
    snprintf(path_text[turn], sizeof path_text[turn], "%s/%s", directory, name);
    return path_text[turn];
}

static bool exists(const char *path) {
    struct stat info;
    return stat(path, &info) == 0;
}

static char *slurp(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    *bytes = (size_t)ftell(file);
    rewind(file);
    char *data = (char *)malloc(*bytes + 1);
    assert_non_null(data);
    assert_int_equal(fread(data, 1, *bytes, file), *bytes);
    data[*bytes] = '\0';
    fclose(file);
    return data;
}

static void spill(const char *path, const void *data, size_t bytes) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, bytes, file), bytes);
    fclose(file);
}

static void assert_no_part(const char *path) {
    char part[220];
    snprintf(part, sizeof part, "%s.part", path);
    assert_false(exists(part));
}

/* one line, not empty, that says the words */
static void assert_says(const sphpa_error *err, sphpa_result result, const char *words) {
    if (err->result != result || strstr(err->message, words) == NULL ||
        strchr(err->message, '\n') != NULL) {
        print_error("expected %d \"%s\", got %d: %s\n", (int)result, words, (int)err->result,
                    err->message);
        fail();
    }
}

static void assert_nothing_open(void) {
    assert_int_equal(H5Fget_obj_count((hid_t)H5F_OBJ_ALL, H5F_OBJ_ALL), 0);
}

static int setup_directory(void **state) {
    (void)state;
    for (unsigned k = 0;; k++) {
        snprintf(directory + strlen(directory) - 6, 7, "%06u", k);
        if (mkdir(directory, 0777) == 0) return 0;
        if (k > 100000) return -1;
    }
}

static int remove_directory(void **state) {
    char command[300];
    (void)state;
    snprintf(command, sizeof command, "rm -rf '%s'", directory);
    return system(command);
}

/* ---- layout ---------------------------------------------------------------------------------- */

static hid_t object_of(hid_t file, const char *path, const char *attribute, hid_t *type,
                       hssize_t *count, bool *scalar) {
    hid_t object = H5Oopen(file, path, H5P_DEFAULT);
    if (object < 0 || H5Aexists(object, attribute) <= 0) fail_msg("no %s of %s", attribute, path);
    hid_t found = H5Aopen(object, attribute, H5P_DEFAULT), space = H5Aget_space(found);
    *type = H5Aget_type(found);
    *count = H5Sget_simple_extent_npoints(space);
    *scalar = H5Sget_simple_extent_type(space) == H5S_SCALAR;
    H5Sclose(space);
    H5Oclose(object);
    return found;
}

/* an array of exactly these numbers, in exactly this type */
static void numbers_are(hid_t file, const char *path, const char *name, hid_t want, int n,
                        const double *values) {
    hid_t type;
    hssize_t count;
    bool scalar;
    double have[16];
    hid_t attribute = object_of(file, path, name, &type, &count, &scalar);
    if (H5Tequal(type, want) <= 0) fail_msg("%s of %s has another type", name, path);
    assert_false(scalar);
    assert_int_equal(count, n);
    assert_true(H5Aread(attribute, H5T_NATIVE_DOUBLE, have) >= 0);
    for (int k = 0; k < n; k++)
        if (memcmp(&have[k], &values[k], sizeof(double)) != 0)
            fail_msg("%s of %s: %.17g, not %.17g", name, path, have[k], values[k]);
    H5Tclose(type);
    H5Aclose(attribute);
}

static void number_is(hid_t file, const char *path, const char *name, hid_t want, double value) {
    numbers_are(file, path, name, want, 1, &value);
}

/* a scalar string of fixed length, ASCII, exactly strlen bytes; text NULL: anything not empty */
static void string_is(hid_t file, const char *path, const char *name, const char *text) {
    hid_t type;
    hssize_t count;
    bool scalar;
    char have[600];
    memset(have, 0, sizeof have);
    hid_t attribute = object_of(file, path, name, &type, &count, &scalar);
    assert_true(scalar);
    assert_int_equal(H5Tget_class(type), H5T_STRING);
    assert_true(H5Tis_variable_str(type) == 0);
    assert_int_equal(H5Tget_cset(type), H5T_CSET_ASCII);
    assert_true(H5Tget_size(type) < sizeof have);
    assert_true(H5Aread(attribute, type, have) >= 0);
    if (text != NULL) assert_string_equal(have, text);
    if (text == NULL || text[0] != '\0') assert_int_equal(H5Tget_size(type), strlen(have));
    assert_true(strlen(have) > 0 || (text != NULL && text[0] == '\0'));
    H5Tclose(type);
    H5Aclose(attribute);
}

static bool same_object(hid_t file, const char *a, const char *b) {
#if H5_VERSION_GE(1, 12, 0)
    H5O_info2_t one, two;
    assert_true(H5Oget_info_by_name3(file, a, &one, H5O_INFO_BASIC, H5P_DEFAULT) >= 0);
    assert_true(H5Oget_info_by_name3(file, b, &two, H5O_INFO_BASIC, H5P_DEFAULT) >= 0);
    return memcmp(&one.token, &two.token, sizeof one.token) == 0;
#else
    H5O_info_t one, two;
    assert_true(H5Oget_info_by_name(file, a, &one, H5P_DEFAULT) >= 0);
    assert_true(H5Oget_info_by_name(file, b, &two, H5P_DEFAULT) >= 0);
    return one.addr == two.addr;
#endif
}

static H5L_type_t link_type(hid_t file, const char *path) {
    H5L_info_t info;
    assert_true(H5Lget_info(file, path, &info, H5P_DEFAULT) >= 0);
    return info.type;
}

/* a dataset of exactly this type and shape, read into data */
static void dataset_into(hid_t file, const char *path, hid_t want, size_t n, size_t components,
                         void *data) {
    hsize_t dims[2] = {0, 1};
    hid_t set = H5Dopen2(file, path, H5P_DEFAULT);
    if (set < 0) fail_msg("no dataset %s", path);
    hid_t type = H5Dget_type(set), space = H5Dget_space(set);
    if (H5Tequal(type, want) <= 0) fail_msg("%s has another type", path);
    assert_int_equal(H5Sget_simple_extent_dims(space, dims, NULL), components > 1 ? 2 : 1);
    assert_int_equal(dims[0], n);
    assert_int_equal(dims[1], components);
    assert_true(H5Dread(set, want, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0);
    H5Sclose(space);
    H5Tclose(type);
    H5Dclose(set);
}

static hid_t type_of(sphpa_type type) {
    if (type == SPHPA_TYPE_double) return H5T_IEEE_F64LE;
    if (type == SPHPA_TYPE_sphpa_real)
        return sizeof(sphpa_real) == 8 ? H5T_IEEE_F64LE : H5T_IEEE_F32LE;
    if (type == SPHPA_TYPE_int64_t) return H5T_STD_I64LE;
    return type == SPHPA_TYPE_int32_t ? H5T_STD_I32LE : H5T_STD_U32LE;
}

static void check_attributes(hid_t file, const world *w) {
    const hid_t f64 = H5T_IEEE_F64LE, i32 = H5T_STD_I32LE, i64 = H5T_STD_I64LE;
    const double n[7] = {(double)w->sim.p.n, 0, 0, 0, 0, 0, 0}, none[7] = {0, 0, 0, 0, 0, 0, 0};
    const double can[7] = {1, 0, 0, 0, 0, 0, 0}, box[3] = {2, 2, 2};
    string_is(file, "/Header", "Code", "SWIFT");
    numbers_are(file, "/Header", "BoxSize", f64, 3, box);
    number_is(file, "/Header", "Dimension", i32, w->dim);
    number_is(file, "/Header", "Time", f64, w->sim.time);
    number_is(file, "/Header", "Redshift", f64, 0.0);
    number_is(file, "/Header", "Scale-factor", f64, 1.0);
    numbers_are(file, "/Header", "NumPart_ThisFile", i64, 7, n);
    numbers_are(file, "/Header", "NumPart_Total", H5T_STD_U32LE, 7, n);
    numbers_are(file, "/Header", "NumPart_Total_HighWord", H5T_STD_U32LE, 7, none);
    numbers_are(file, "/Header", "MassTable", f64, 7, none);
    number_is(file, "/Header", "NumFilesPerSnapshot", i32, 1);
    number_is(file, "/Header", "ThisFile", i32, 0);
    string_is(file, "/Header", "OutputType", "FullVolume");
    string_is(file, "/Header", "RunName", "a run");
    numbers_are(file, "/Header", "CanHaveTypes", i32, 7, can);
    string_is(file, "/Header", "SnapshotDate", NULL);
    static const char *const units[] = {"/Units", "/InternalCodeUnits"};
    for (int k = 0; k < 2; k++) {
        number_is(file, units[k], "Unit mass in cgs (U_M)", f64, 1e3);
        number_is(file, units[k], "Unit length in cgs (U_L)", f64, 1e2);
        number_is(file, units[k], "Unit time in cgs (U_t)", f64, 1.0);
        number_is(file, units[k], "Unit current in cgs (U_I)", f64, 1.0);
        number_is(file, units[k], "Unit temperature in cgs (U_T)", f64, 1.0);
    }
    number_is(file, "/Policy", "cosmological integration", i32, 0);
    number_is(file, "/Cosmology", "Cosmological run", i32, 0);
    string_is(file, "/Parameters", "InitialConditions:periodic", "1");
    string_is(file, "/Parameters", "Gas:eta", "1.2");
    string_is(file, "/Parameters", "Run:empty", "");
    number_is(file, "/RuntimePars", "PeriodicBoundariesOn", i32, 1);
    string_is(file, "/HydroScheme", "Kernel function", "cubic");
    number_is(file, "/HydroScheme", "Dimension", i32, w->dim);
    string_is(file, "/HydroScheme", "Scheme", "sphpa");
    assert_true(H5Lexists(file, "/SubgridScheme", H5P_DEFAULT) > 0);
    string_is(file, "/Code", "Code", "sphpa");
    string_is(file, "/Code", "Code Version", SPHPA_VERSION);
    string_is(file, "/Code", "Compiler Name", NULL);
    string_is(file, "/Code", "CFLAGS", "-O2");
    string_is(file, "/Code", "sphpa build", NULL);
    assert_int_equal(link_type(file, "/GasParticles"), H5L_TYPE_SOFT);
    assert_true(same_object(file, "/GasParticles", "/PartType0"));
}

static void check_vtk(hid_t file, size_t n) {
    const double version[2] = {1, 0};
    int64_t count = -1, offsets[2] = {-1, -1};
    unsigned char type = 0;
    int64_t *place = (int64_t *)malloc(n * sizeof(int64_t));
    assert_non_null(place);
    numbers_are(file, "/VTKHDF", "Version", H5T_STD_I64LE, 2, version);
    string_is(file, "/VTKHDF", "Type", "UnstructuredGrid");
    dataset_into(file, "/VTKHDF/Types", H5T_STD_U8LE, 1, 1, &type);
    assert_int_equal(type, 2);
    dataset_into(file, "/VTKHDF/Offsets", H5T_STD_I64LE, 2, 1, offsets);
    assert_int_equal(offsets[0], 0);
    assert_int_equal(offsets[1], n);
    dataset_into(file, "/VTKHDF/Connectivity", H5T_STD_I64LE, n, 1, place);
    for (size_t k = 0; k < n; k++) assert_int_equal(place[k], k);
    dataset_into(file, "/VTKHDF/NumberOfPoints", H5T_STD_I64LE, 1, 1, &count);
    assert_int_equal(count, n);
    dataset_into(file, "/VTKHDF/NumberOfCells", H5T_STD_I64LE, 1, 1, &count);
    assert_int_equal(count, 1);
    dataset_into(file, "/VTKHDF/NumberOfConnectivityIds", H5T_STD_I64LE, 1, 1, &count);
    assert_int_equal(count, n);
    assert_true(same_object(file, "/VTKHDF/Points", "/PartType0/Coordinates"));
    free(place);
}

/* one field or column: its bits, its unit, its text, and its place in /VTKHDF */
static void check_field(hid_t file, const char *name, const sphpa_field_info *info,
                        const void *data, size_t n) {
    char path[100], vtk[100];
    snprintf(path, sizeof path, "/PartType0/%s", name);
    snprintf(vtk, sizeof vtk, "/VTKHDF/PointData/%s", name);
    void *have = malloc(n * info->bytes);
    assert_non_null(have);
    dataset_into(file, path, type_of(info->type), n, (size_t)info->components, have);
    assert_memory_equal(have, data, n * info->bytes);
    free(have);
    number_is(file, path, "U_L exponent", H5T_IEEE_F64LE, info->length);
    number_is(file, path, "U_M exponent", H5T_IEEE_F64LE, info->mass);
    number_is(file, path, "U_t exponent", H5T_IEEE_F64LE, info->time);
    number_is(file, path, "U_I exponent", H5T_IEEE_F64LE, 0.0);
    number_is(file, path, "U_T exponent", H5T_IEEE_F64LE, 0.0);
    number_is(file, path, "a-scale exponent", H5T_IEEE_F64LE, 0.0);
    number_is(file, path, "h-scale exponent", H5T_IEEE_F64LE, 0.0);
    string_is(file, path, "Description", info->meaning);
    if (strcmp(name, "Coordinates") != 0) assert_true(same_object(file, vtk, path));
    else assert_true(H5Lexists(file, vtk, H5P_DEFAULT) == 0);
}

/* `all`: a checkpoint. Which fields a plain snapshot has is spelled out here. */
static void check_fields(hid_t file, const world *w, bool all) {
    const sphpa_particles *p = &w->sim.p;
    static const char *const plain[] = {"x", "v", "m", "h", "rho", "u", "P", "c", "id", "material",
                                        "body", "mu_max", "omega", "div_v", "S"};
    size_t written = 0, links = 4; /* the singular names */
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        sphpa_field_info info = sphpa_field_describe((sphpa_field)k);
        bool have = ((p->fields >> k) & 1u) != 0, expected = all && have;
        for (size_t j = 0; j < sizeof plain / sizeof plain[0]; j++)
            expected = expected || strcmp(plain[j], info.name) == 0;
        char path[100];
        snprintf(path, sizeof path, "/PartType0/%s", info.file_name);
        if (!expected) assert_true(H5Lexists(file, path, H5P_DEFAULT) == 0);
        else check_field(file, info.file_name, &info,
                         sphpa_particles_data(p, (sphpa_field)k, 0), p->n);
        written += expected;
    }
    sphpa_field_info dye_info;
    memset(&dye_info, 0, sizeof dye_info);
    dye_info.components = 2;
    dye_info.bytes = 16;
    dye_info.length = 2;
    dye_info.time = -1;
    dye_info.meaning = NULL;
    check_field(file, "Dye", &dye_info, p->column[0].data, p->n);
    H5G_info_t group;
    assert_true(H5Gget_info_by_name(file, "/PartType0", &group, H5P_DEFAULT) >= 0);
    assert_int_equal(group.nlinks, written + links + 1);
    assert_true(H5Gget_info_by_name(file, "/VTKHDF/PointData", &group, H5P_DEFAULT) >= 0);
    assert_int_equal(group.nlinks, written); /* without Coordinates, with Dye */
    assert_true(same_object(file, "/PartType0/SmoothingLength", "/PartType0/SmoothingLengths"));
    assert_true(same_object(file, "/PartType0/Density", "/PartType0/Densities"));
    assert_true(same_object(file, "/PartType0/InternalEnergy", "/PartType0/InternalEnergies"));
    assert_true(same_object(file, "/PartType0/Pressure", "/PartType0/Pressures"));
}

static const sphpa_setting settings[] = {{"Gas:eta", "1.2"}, {"Run:empty", ""}};

static sphpa_snapshot_info info_of_run(void) {
    sphpa_snapshot_info info;
    memset(&info, 0, sizeof info);
    info.run = "a run";
    info.cflags = "-O2";
    info.settings = settings;
    info.settings_count = 2;
    return info;
}

static void test_layout(void **state) {
    (void)state;
    world *w = world_new(2, 14);
    world_make(w);
    steps(&w->sim, 5);
    sphpa_error err;
    sphpa_snapshot_info info = info_of_run();
    assert_int_equal(sphpa_sim_refresh(&w->sim, &err), SPHPA_OK);
    for (int restart = 0; restart < 2; restart++) {
        const char *path = at(restart ? "layout_restart.hdf" : "layout.hdf");
        sphpa_result result = restart ? sphpa_checkpoint_write(&w->sim, path, &info, &err)
                                      : sphpa_snapshot_write(&w->sim, path, &info, &err);
        assert_int_equal(result, SPHPA_OK);
        assert_no_part(path);
        assert_nothing_open();
        hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
        assert_true(file >= 0);
        check_attributes(file, w);
        check_vtk(file, w->sim.p.n);
        check_fields(file, w, restart != 0);
        string_is(file, "/sphpa", "kind", restart ? "checkpoint" : "snapshot");
        H5Fclose(file);
    }
    world_free(w);
}

/* a zeroed info, or none; an open box: from the origin or around all, with the supports */
static void test_open_box_and_defaults(void **state) {
    (void)state;
    world *w = world_new(1, 20);
    sphpa_error err;
    memset(&w->options.box, 0, sizeof w->options.box);
    world_make(w);
    steps(&w->sim, 2);
    double low = 0.0, high = 0.0;
    for (size_t i = 0; i < w->sim.p.n; i++) {
        double x = w->sim.p.x[3 * i], reach = 2.0 * (double)w->sim.p.h[i];
        low = fmin(low, x - reach);
        high = fmax(high, x + reach);
        w->sim.p.x[3 * i + 1] = 0.25; /* beyond dim: written as 0 */
    }
    const double box[3] = {high - low, high - low, high - low};
    assert_true(box[0] > 2.0 && box[0] < 3.0);
    assert_int_equal(sphpa_snapshot_write(&w->sim, at("open.hdf"), NULL, &err), SPHPA_OK);
    hid_t file = H5Fopen(at("open.hdf"), H5F_ACC_RDONLY, H5P_DEFAULT);
    numbers_are(file, "/Header", "BoxSize", H5T_IEEE_F64LE, 3, box);
    number_is(file, "/Header", "Dimension", H5T_STD_I32LE, 1);
    string_is(file, "/Header", "RunName", "sphpa");
    string_is(file, "/Parameters", "InitialConditions:periodic", "0");
    number_is(file, "/RuntimePars", "PeriodicBoundariesOn", H5T_STD_I32LE, 0);
    double x[60];
    dataset_into(file, "/PartType0/Coordinates", H5T_IEEE_F64LE, 20, 3, x);
    for (size_t k = 0; k < 60; k++) assert_true(x[k] == (k % 3 ? 0.0 : w->sim.p.x[k]));
    H5Fclose(file);
    world_free(w);
}

/* other tools know boxes that wrap on all axes or none: one that is periodic along some is told as
   open, though its sides along those are the period */
static void test_partly_periodic_box(void **state) {
    (void)state;
    for (int axis = 0; axis < 2; axis++) {
        world *w = world_new(2, 10);
        sphpa_error err;
        w->options.box.periodic[axis] = 0;
        w->options.box.low[axis] = w->options.box.high[axis] = 0.0;
        world_make(w);
        double low = 0.0, high = 0.0;
        for (size_t i = 0; i < w->sim.p.n; i++) {
            double x = w->sim.p.x[3 * i + (size_t)axis], reach = 2.0 * (double)w->sim.p.h[i];
            low = fmin(low, x - reach);
            high = fmax(high, x + reach);
        }
        assert_true(high - low > 2.0);
        double box[3] = {2.0, 2.0, high - low};
        box[axis] = high - low;
        assert_int_equal(sphpa_snapshot_write(&w->sim, at("partly.hdf"), NULL, &err), SPHPA_OK);
        hid_t file = H5Fopen(at("partly.hdf"), H5F_ACC_RDONLY, H5P_DEFAULT);
        numbers_are(file, "/Header", "BoxSize", H5T_IEEE_F64LE, 3, box);
        string_is(file, "/Parameters", "InitialConditions:periodic", "0");
        number_is(file, "/RuntimePars", "PeriodicBoundariesOn", H5T_STD_I32LE, 0);
        H5Fclose(file);
        world_free(w);
    }
}

/* ---- restart --------------------------------------------------------------------------------- */

/* stopped half way and resumed, from the same and from other particles: the bits of the one that
   went on */
static void restart_case(int dim, int cells, sphpa_integrator integrator, int balsara,
                         int scheme) {
    world *w[3];
    int half = scheme > 0 ? 22 : 20; /* GSPH and ADKE renew h in every fourth step */
    sphpa_error err;
    for (int k = 0; k < 3; k++) {
        w[k] = world_new(dim, k == 2 ? cells + 3 : cells);
        w[k]->options.integrator = integrator;
        w[k]->params.viscosity.balsara = balsara;
        w[k]->scheme = scheme;
        world_make(w[k]);
    }
    steps(&w[0]->sim, half);
    assert_int_equal(sphpa_sim_refresh(&w[0]->sim, &err), SPHPA_OK); /* as at an output */
    assert_int_equal(sphpa_checkpoint_write(&w[0]->sim, at("run.hdf"), NULL, &err), SPHPA_OK);
    steps(&w[1]->sim, half - 1); /* has lists of its own that nearly fit, and a history */
    for (int k = 1; k < 3; k++) {
        assert_int_equal(sphpa_checkpoint_read(&w[k]->sim, at("run.hdf"), &err), SPHPA_OK);
        assert_same_bits(&w[0]->sim, &w[k]->sim);
        assert_int_equal(w[k]->colour.count, half);
    }
    for (int k = 0; k < 3; k++) steps(&w[k]->sim, half);
    assert_true(w[0]->sim.stats.steps == 2 * (uint64_t)half && w[0]->colour.count == 2 * half);
    for (int k = 1; k < 3; k++) {
        assert_same_bits(&w[0]->sim, &w[k]->sim);
        assert_int_equal(w[k]->colour.count, 2 * half);
        assert_memory_equal(w[0]->colour.history, w[k]->colour.history, 2 * (size_t)half * sizeof(double));
    }
    assert_nothing_open();
    for (int k = 0; k < 3; k++) world_free(w[k]);
}

/* walls at x = -1.01 and y = 1.01, open edges opposite of them, and a wind to these */
static world *world_with_edges(void) {
    world *w = world_new(2, 14);
    memset(w->options.box.periodic, 0, sizeof w->options.box.periodic);
    w->edged = 1;
    for (int a = 0; a < 2; a++) w->edges.low[a] = -1.01, w->edges.high[a] = 1.01;
    w->edges.edge_low[0] = w->edges.edge_high[1] = SPHPA_EDGE_WALL;
    w->edges.edge_high[0] = w->edges.edge_low[1] = SPHPA_EDGE_OPEN;
    return w;
}

/* images, parents and what is lost so far are in the file, and the run goes on as it would have */
static void test_restart_with_edges(void **state) {
    (void)state;
    world *w[3];
    sphpa_error err;
    for (int k = 0; k < 3; k++) {
        w[k] = world_with_edges();
        world_make(w[k]);
    }
    const char *path = at("edges.hdf");
    while (w[0]->edges.lost_count == 0) steps(&w[0]->sim, 1);
    assert_int_equal(sphpa_sim_refresh(&w[0]->sim, &err), SPHPA_OK);
    assert_int_equal(sphpa_checkpoint_write(&w[0]->sim, path, NULL, &err), SPHPA_OK);
    steps(&w[1]->sim, 19);
    const sphpa_particles *p = &w[0]->sim.p;
    size_t images = 0, n = p->n;
    int32_t *ghost = (int32_t *)malloc(2 * n * sizeof(int32_t)), *parent = ghost + n;
    hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    dataset_into(file, "/PartType0/GhostImages", H5T_STD_I32LE, n, 1, ghost);
    dataset_into(file, "/PartType0/GhostParents", H5T_STD_I32LE, n, 1, parent);
    H5Fclose(file);
    for (size_t i = 0; i < n; i++) {
        assert_true(ghost[i] == p->ghost[i] && parent[i] == p->parent[i]);
        images += ghost[i] > 1 ? 1u : 0u;
    }
    assert_true(images > 0 && n == images + 14 * 14 - w[0]->edges.lost_count);
    free(ghost);
    for (int turn = 0; turn < 2; turn++) {
        for (int k = 1; k < 3; k++) {
            if (turn == 0)
                assert_int_equal(sphpa_checkpoint_read(&w[k]->sim, path, &err), SPHPA_OK);
            assert_same_bits(&w[0]->sim, &w[k]->sim);
            assert_memory_equal(w[0]->edges.lost, w[k]->edges.lost, sizeof w[k]->edges.lost);
            assert_int_equal(w[0]->edges.lost_count, w[k]->edges.lost_count);
        }
        if (turn == 0)
            for (int k = 0; k < 3; k++) steps(&w[k]->sim, 60);
    }
    assert_true(w[0]->edges.lost_count > 3);
    assert_nothing_open();
    for (int k = 0; k < 3; k++) world_free(w[k]);
}

static void test_restart(void **state) {
    (void)state;
    restart_case(1, 60, SPHPA_PREDICTOR_CORRECTOR, 0, 0);
    restart_case(2, 14, SPHPA_PREDICTOR_CORRECTOR, 1, 0);
    restart_case(2, 14, SPHPA_RK2, 0, 0);
    restart_case(3, 8, SPHPA_PREDICTOR_CORRECTOR, 0, 0);
}

/* GSPH, ADKE, MPM: h of a pilot density that is not renewed in every step, switches of their own */
static void test_restart_of_strong_shocks(void **state) {
    (void)state;
    for (int scheme = 1; scheme <= 3; scheme++) {
        restart_case(1, 60, SPHPA_PREDICTOR_CORRECTOR, 0, scheme);
        restart_case(2, 25, SPHPA_PREDICTOR_CORRECTOR, 0, scheme);
        restart_case(2, 14, SPHPA_RK2, 0, scheme);
    }
}

/* before the first step, and what a run has counted so far */
static void test_restart_of_anything(void **state) {
    (void)state;
    world *a = world_new(2, 10), *b = world_new(2, 10);
    sphpa_error err;
    world_make(a);
    world_make(b);
    a->sim.stats.u_deficit = 0.125;
    a->sim.stats.u_below = 3;
    a->sim.p.next_id = 4711;
    a->sim.p.x[2] = 0.25; /* beyond dim: a restart needs what is there */
    assert_int_equal(sphpa_checkpoint_write(&a->sim, at("zero.hdf"), NULL, &err), SPHPA_OK);
    assert_int_equal(sphpa_checkpoint_read(&b->sim, at("zero.hdf"), &err), SPHPA_OK);
    assert_same_bits(&a->sim, &b->sim);
    assert_int_equal(b->sim.started, 0);
    steps(&a->sim, 4);
    steps(&b->sim, 4);
    assert_same_bits(&a->sim, &b->sim);
    assert_int_equal(b->sim.p.next_id, 4711);
    world_free(a);
    world_free(b);
}

/* a smaller cfl counts from the first step on; the same cfl changes nothing */
static void test_restart_with_smaller_steps(void **state) {
    (void)state;
    world *a = world_new(2, 10), *b = world_new(2, 10);
    world *c = world_new(2, 10), *d = world_new(2, 10);
    sphpa_error err;
    b->options.cfl = 0.15;
    c->options.dt_max = 1e-5;
    d->options.dt_fixed = 2e-5;
    world_make(a);
    world_make(b);
    world_make(c);
    world_make(d);
    steps(&a->sim, 3);
    assert_int_equal(sphpa_checkpoint_write(&a->sim, at("cfl.hdf"), NULL, &err), SPHPA_OK);
    assert_int_equal(sphpa_checkpoint_read(&b->sim, at("cfl.hdf"), &err), SPHPA_OK);
    assert_int_equal(sphpa_checkpoint_read(&c->sim, at("cfl.hdf"), &err), SPHPA_OK);
    assert_int_equal(sphpa_checkpoint_read(&d->sim, at("cfl.hdf"), &err), SPHPA_OK);
    assert_near(b->sim.dt_next, 0.5 * a->sim.dt_next, 1e-15);
    assert_true(a->sim.dt_next > 1e-5 && c->sim.dt_next == 1e-5 && d->sim.dt_next == 2e-5);
    world_free(a);
    world_free(b);
    world_free(c);
    world_free(d);
}

/* as little as the stricter of both limits asks; a larger one waits for the step's end */
static void test_restart_with_other_limits(void **state) {
    (void)state;
    static const double cfl[5] = {0.0, 0.0, 0.6, 0.15, 0.1};
    static const double force_cfl[5] = {0.1, 0.4, 0.05, 0.05, 0.19};
    static const double share[5] = {0.5, 1.0, 0.25, 0.25, 1.0 / 3.0}; /* of 0.3 and of 0.2 */
    world *a = world_new(2, 10);
    sphpa_error err;
    world_make(a);
    steps(&a->sim, 3);
    assert_int_equal(sphpa_checkpoint_write(&a->sim, at("limits.hdf"), NULL, &err), SPHPA_OK);
    for (int k = 0; k < 5; k++) {
        world *b = world_new(2, 10);
        b->options.cfl = cfl[k];
        b->options.force_cfl = force_cfl[k];
        world_make(b);
        assert_int_equal(sphpa_checkpoint_read(&b->sim, at("limits.hdf"), &err), SPHPA_OK);
        assert_near(b->sim.dt_next, share[k] * a->sim.dt_next, 1e-15);
        world_free(b);
    }
    world_free(a);
}

/* What an output has put aside to give back before the next step is of the state that was: a
   restart in between, of the same particles in the same order, must not get it. */
static void test_restart_after_an_output(void **state) {
    (void)state;
    world *w[2];
    sphpa_error err;
    for (int k = 0; k < 2; k++) {
        w[k] = world_new(2, 14);
        world_make(w[k]);
    }
    steps(&w[0]->sim, 5);
    assert_int_equal(sphpa_checkpoint_write(&w[0]->sim, at("output.hdf"), NULL, &err), SPHPA_OK);
    assert_int_equal(sphpa_sim_step(&w[0]->sim, 1e-3, &err), SPHPA_OK);
    assert_int_equal(sphpa_sim_refresh(&w[0]->sim, &err), SPHPA_OK);
    int64_t order[196];
    assert_int_equal(w[0]->sim.p.n, 196);
    memcpy(order, w[0]->sim.p.id, sizeof order);
    for (int k = 0; k < 2; k++)
        assert_int_equal(sphpa_checkpoint_read(&w[k]->sim, at("output.hdf"), &err), SPHPA_OK);
    assert_memory_equal(order, w[0]->sim.p.id, sizeof order);
    for (int k = 0; k < 2; k++) steps(&w[k]->sim, 1);
    assert_same_bits(&w[0]->sim, &w[1]->sim);
    for (int k = 0; k < 2; k++) world_free(w[k]);
}

static void test_blobs(void **state) {
    (void)state;
    world *w = world_new(2, 10);
    world_make(w);
    const double gauge[5] = {1.0, -2.0, 3e300, 0.0, 5.0};
    double back[5] = {9.0, 9.0, 9.0, 9.0, 9.0};
    sphpa_blob blobs[2] = {{"gauge", gauge, sizeof gauge}, {"nothing", NULL, 0}};
    sphpa_snapshot_info info = info_of_run();
    sphpa_error err;
    info.blobs = blobs;
    info.blobs_count = 2;
    assert_int_equal(sphpa_checkpoint_write(&w->sim, at("blob.hdf"), &info, &err), SPHPA_OK);
    const char *path = at("blob.hdf");
    assert_int_equal(sphpa_checkpoint_blob(path, "gauge", back, 16, &err), SPHPA_ERROR_FORMAT);
    assert_says(&err, SPHPA_ERROR_FORMAT, "40 bytes, not 16");
    assert_int_equal(sphpa_checkpoint_blob(path, "gaug", back, 40, &err), SPHPA_ERROR_MISSING);
    assert_says(&err, SPHPA_ERROR_MISSING, "no blob \"gaug\"");
    assert_int_equal(sphpa_checkpoint_blob(path, "../Kept/dye.history", back, 40, &err),
                     SPHPA_ERROR_MISSING);
    for (int k = 0; k < 5; k++) assert_true(back[k] == 9.0);
    assert_int_equal(sphpa_checkpoint_blob(path, "gauge", back, sizeof back, &err), SPHPA_OK);
    assert_memory_equal(back, gauge, sizeof gauge);
    assert_int_equal(sphpa_checkpoint_blob(path, "nothing", back, 0, &err), SPHPA_OK);
    blobs[0].name = "a/b";
    assert_int_equal(sphpa_checkpoint_write(&w->sim, at("blob2.hdf"), &info, &err),
                     SPHPA_ERROR_RANGE);
    assert_says(&err, SPHPA_ERROR_RANGE, "a/b");
    blobs[0].name = "nothing"; /* twice */
    assert_int_not_equal(sphpa_checkpoint_write(&w->sim, at("blob2.hdf"), &info, &err), SPHPA_OK);
    assert_false(exists(at("blob2.hdf")));
    assert_nothing_open();
    world_free(w);
}

/* ---- a snapshot as the start of a scene ------------------------------------------------------ */

static void test_snapshot_as_start(void **state) {
    (void)state;
    world *w = world_new(2, 12);
    world_make(w);
    steps(&w->sim, 7);
    sphpa_error err;
    sphpa_particles p;
    double time = -1.0;
    assert_int_equal(sphpa_sim_settle(&w->sim, &err), SPHPA_OK);
    for (size_t i = 0; i < w->sim.p.n; i++) w->sim.p.id[i] += 1000; /* to be kept */
    assert_int_equal(sphpa_snapshot_write(&w->sim, at("start.hdf"), NULL, &err), SPHPA_OK);
    assert_int_equal(sphpa_snapshot_read(at("start.hdf"), &p, &time, &err), SPHPA_OK);
    assert_true(time == w->sim.time && p.n == w->sim.p.n && p.dim == 2);
    assert_int_equal(p.next_id, 1000 + 144);
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        sphpa_field_info info = sphpa_field_describe((sphpa_field)k);
        bool carried = info.role == SPHPA_ROLE_STATE || info.role == SPHPA_ROLE_CONSTANT;
        bool have = ((w->sim.p.fields >> k) & 1u) != 0;
        assert_int_equal((p.fields >> k) & 1u, have && carried ? 1 : 0);
        if (have && carried)
            assert_memory_equal(sphpa_particles_data(&p, (sphpa_field)k, 0),
                                sphpa_particles_data(&w->sim.p, (sphpa_field)k, 0),
                                p.n * info.bytes);
    }
    assert_int_equal(p.columns, 1);
    assert_true(p.column[0].components == 2 && p.column[0].length == 2 && p.column[0].time == -1);
    assert_non_null(sphpa_particles_column(&p, "Dye"));
    assert_memory_equal(sphpa_particles_column(&p, "Dye"), w->sim.p.column[0].data,
                        p.n * 2 * sizeof(double));
    /* it is the start of a scene: the column goes along */
    world *next = world_new(2, 12);
    world_make(next);
    sphpa_scene scene = next->sim.scene;
    sphpa_sim_free(&next->sim);
    assert_int_equal(sphpa_sim_create(&next->sim, &scene, &p, &next->options, &err), SPHPA_OK);
    assert_memory_equal(next->sim.p.column[0].data, w->sim.p.column[0].data,
                        p.n * 2 * sizeof(double));
    steps(&next->sim, 2);
    sphpa_particles_free(&p);
    world_free(w);
    world_free(next);
}

static void add_set(hid_t group, const char *name, hid_t type, size_t n, size_t components,
                    const double *values) {
    hsize_t dims[2] = {(hsize_t)n, (hsize_t)components};
    hid_t space = H5Screate_simple(components > 1 ? 2 : 1, dims, NULL);
    hid_t set = H5Dcreate2(group, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0);
    H5Dclose(set);
    H5Sclose(space);
}

static void add_number(hid_t object, const char *name, double value) {
    hsize_t one = 1;
    hid_t space = H5Screate_simple(1, &one, NULL);
    hid_t a = H5Acreate2(object, name, H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(a >= 0 && H5Awrite(a, H5T_NATIVE_DOUBLE, &value) >= 0);
    H5Aclose(a);
    H5Sclose(space);
}

enum { FOREIGN_UNITS = 1, FOREIGN_EXPONENTS = 2, FOREIGN_NO_MASSES = 4, FOREIGN_SCALE = 8,
       FOREIGN_SPLIT = 16, FOREIGN_SHORT = 32, FOREIGN_NEGATIVE = 64, FOREIGN_IDS = 128,
       FOREIGN_EMPTY = 256, FOREIGN_INTEGER = 512, FOREIGN_FOUR = 1024 };

/* a file as another program writes it: two particles in floats, under SWIFT's former names */
static void foreign_file(const char *path, int flags) {
    const double x[6] = {1, 2, 3, 4, 5, 6}, v[6] = {7, 8, 9, 10, 11, 12}, m[2] = {2, 4};
    const double h[2] = {0.5, 0.25}, u[2] = {32, 64}, ids[2] = {5, 3};
    double rho[2] = {8, 16};
    if (flags & FOREIGN_NEGATIVE) rho[1] = -16.0;
    size_t n = flags & FOREIGN_EMPTY ? 0 : 2;
    hid_t file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    assert_true(file >= 0);
    hid_t header = H5Gcreate2(file, "Header", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    hid_t gas = H5Gcreate2(file, "PartType0", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    hid_t units = -1;
    add_number(header, "Dimension", flags & FOREIGN_FOUR ? 4.0 : 3.0);
    add_number(header, "Time", 3.0);
    if (flags & FOREIGN_SCALE) add_number(header, "Scale-factor", 0.5);
    if (flags & FOREIGN_SPLIT) add_number(header, "NumFilesPerSnapshot", 4.0);
    if (flags & FOREIGN_UNITS) { /* 10 m, 5 kg, 2 s */
        units = H5Gcreate2(file, "Units", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
        add_number(units, "Unit length in cgs (U_L)", 1e3);
        add_number(units, "Unit mass in cgs (U_M)", 5e3);
        add_number(units, "Unit time in cgs (U_t)", 2.0);
    }
    hid_t real = H5T_IEEE_F32BE;
    add_set(gas, "Coordinates", real, n, 3, x);
    add_set(gas, "Velocities", real, n, 3, v);
    if (!(flags & FOREIGN_NO_MASSES)) add_set(gas, "Masses", real, n, 1, m);
    add_set(gas, "SmoothingLength", real, flags & FOREIGN_SHORT ? 1 : n, 1, h);
    add_set(gas, "Density", flags & FOREIGN_INTEGER ? H5T_STD_I32LE : real, n, 1, rho);
    add_set(gas, "InternalEnergy", real, n, 1, u);
    add_set(gas, "Potentials", real, n, 1, u); /* nobody asked for it */
    if (flags & FOREIGN_IDS) add_set(gas, "ParticleIDs", H5T_STD_U64LE, n, 1, ids);
    if (flags & FOREIGN_EXPONENTS) { /* a file may count otherwise than we do */
        hid_t set = H5Dopen2(gas, "Density", H5P_DEFAULT);
        add_number(set, "U_L exponent", -2.0);
        add_number(set, "U_M exponent", 1.0);
        add_number(set, "U_t exponent", 0.0);
        H5Dclose(set);
    }
    if (units >= 0) H5Gclose(units);
    H5Gclose(header);
    H5Gclose(gas);
    H5Fclose(file);
}

static void test_foreign_units(void **state) {
    (void)state;
    sphpa_particles p;
    sphpa_error err;
    double time = 0.0;
    foreign_file(at("swift.hdf"), FOREIGN_IDS);
    assert_int_equal(sphpa_snapshot_read(at("swift.hdf"), &p, &time, &err), SPHPA_OK);
    assert_true(p.n == 2 && p.dim == 3 && time == 3.0 && p.columns == 0);
    assert_true(p.id[0] == 5 && p.id[1] == 3 && p.next_id == 6);
    assert_true(p.x[5] == 6.0 && (double)p.v[4] == 11.0 && (double)p.m[1] == 4.0 &&
                p.rho[0] == 8.0 && p.u[1] == 64.0 && (double)p.h[0] == 0.5);
    sphpa_particles_free(&p);
    foreign_file(at("swift.hdf"), FOREIGN_UNITS);
    assert_int_equal(sphpa_snapshot_read(at("swift.hdf"), &p, &time, &err), SPHPA_OK);
    assert_true(p.id[0] == 0 && p.id[1] == 1 && p.next_id == 2);
    assert_near(time, 6.0, 1e-15);
    assert_near(p.x[5], 60.0, 1e-15);
    assert_near((double)p.v[4], 55.0, 1e-7);
    assert_near((double)p.m[1], 20.0, 1e-7);
    assert_near((double)p.h[0], 5.0, 1e-7);
    assert_near(p.rho[0], 8.0 * 5.0 / 1000.0, 1e-15);
    assert_near(p.u[1], 64.0 * 25.0, 1e-15);
    sphpa_particles_free(&p);
    foreign_file(at("swift.hdf"), FOREIGN_UNITS | FOREIGN_EXPONENTS);
    assert_int_equal(sphpa_snapshot_read(at("swift.hdf"), &p, NULL, &err), SPHPA_OK);
    assert_near(p.rho[0], 8.0 * 5.0 / 100.0, 1e-15);
    sphpa_particles_free(&p);
    assert_nothing_open();
}

static void test_foreign_errors(void **state) {
    (void)state;
    static const struct {
        int flags;
        sphpa_result result;
        const char *words;
    } row[] = {{FOREIGN_NO_MASSES, SPHPA_ERROR_FORMAT, "/PartType0/Masses is missing"},
               {FOREIGN_SCALE, SPHPA_ERROR_FORMAT, "Scale-factor = 0.5"},
               {FOREIGN_SPLIT, SPHPA_ERROR_FORMAT, "one of 4 files"},
               {FOREIGN_SHORT, SPHPA_ERROR_FORMAT, "1 rows of 1 numbers, not 2 of 1"},
               {FOREIGN_NEGATIVE, SPHPA_ERROR_NEGATIVE, "rho = -16"},
               {FOREIGN_INTEGER, SPHPA_ERROR_FORMAT, "\"Density\" holds numbers of another type"},
               {FOREIGN_FOUR, SPHPA_ERROR_FORMAT, "Dimension = 4"},
               {FOREIGN_EMPTY, SPHPA_ERROR_EMPTY, "no particles"}};
    for (size_t k = 0; k < sizeof row / sizeof row[0]; k++) {
        sphpa_error err;
        sphpa_particles p;
        memset(&p, 0x55, sizeof p);
        double time = 17.0;
        foreign_file(at("bad.hdf"), row[k].flags);
        assert_int_equal(sphpa_snapshot_read(at("bad.hdf"), &p, &time, &err), row[k].result);
        assert_says(&err, row[k].result, row[k].words);
        assert_true(p.n == (size_t)0x5555555555555555u && time == 17.0);
        assert_nothing_open();
    }
}

/* ---- files that are none, and writes that fail ----------------------------------------------- */

/* a run's state to compare with: a simulation that is read into shall stay what it was */
typedef struct witness {
    world *w, *twin;
} witness;

static witness witness_new(void) {
    witness t;
    t.w = world_new(2, 10);
    t.twin = world_new(2, 10);
    world_make(t.w);
    world_make(t.twin);
    steps(&t.w->sim, 3);
    steps(&t.twin->sim, 3);
    return t;
}

static void witness_reads(const witness *t, const char *path, sphpa_result result,
                          const char *words) {
    sphpa_error err;
    memset(&err, 0, sizeof err);
    assert_int_equal(sphpa_checkpoint_read(&t->w->sim, path, &err), result);
    assert_says(&err, result, words);
    if (result != SPHPA_ERROR_RANGE) assert_non_null(strstr(err.message, path));
    assert_same_bits(&t->w->sim, &t->twin->sim);
    assert_int_equal(t->w->colour.count, t->twin->colour.count);
    assert_memory_equal(t->w->colour.history, t->twin->colour.history,
                        t->twin->colour.count * sizeof(double));
    assert_nothing_open();
}

/* after all failures it still makes the same steps */
static void witness_free(witness *t) {
    steps(&t->w->sim, 3);
    steps(&t->twin->sim, 3);
    assert_same_bits(&t->w->sim, &t->twin->sim);
    world_free(t->w);
    world_free(t->twin);
}

static void test_broken_files(void **state) {
    (void)state;
    witness t = witness_new();
    world *w = world_new(2, 10);
    world_make(w);
    steps(&w->sim, 5);
    sphpa_error err;
    sphpa_particles p;
    size_t bytes;
    double back[5];
    assert_int_equal(sphpa_checkpoint_write(&w->sim, at("whole.hdf"), NULL, &err), SPHPA_OK);
    char *whole = slurp(at("whole.hdf"), &bytes);
    const size_t cuts[] = {0, 1, 8, 100, 800, 2048, 5000, bytes / 2, bytes - 100, bytes - 1};
    for (size_t k = 0; k < sizeof cuts / sizeof cuts[0]; k++) {
        const char *path = at("cut.hdf");
        spill(path, whole, cuts[k]);
        witness_reads(&t, path, SPHPA_ERROR_FORMAT, cuts[k] < 8 ? "not an HDF5 file" : "");
        assert_int_equal(sphpa_snapshot_read(path, &p, NULL, &err), SPHPA_ERROR_FORMAT);
        assert_int_equal(sphpa_checkpoint_blob(path, "a", back, 40, &err), SPHPA_ERROR_FORMAT);
    }
    spill(at("cut.hdf"), whole, bytes - 1);
    witness_reads(&t, at("cut.hdf"), SPHPA_ERROR_FORMAT, "truncated");
    spill(at("text.hdf"), "this is no HDF5 file\n", 21);
    witness_reads(&t, at("text.hdf"), SPHPA_ERROR_FORMAT, "not an HDF5 file");
    witness_reads(&t, at("nowhere.hdf"), SPHPA_ERROR_FILE, "No such file");
    witness_reads(&t, at("."), SPHPA_ERROR_FORMAT, "not an HDF5 file");
    foreign_file(at("swift.hdf"), 0);
    witness_reads(&t, at("swift.hdf"), SPHPA_ERROR_FORMAT, "no group /sphpa");
    assert_int_equal(sphpa_snapshot_write(&w->sim, at("plain.hdf"), NULL, &err), SPHPA_OK);
    witness_reads(&t, at("plain.hdf"), SPHPA_ERROR_FORMAT, "a snapshot, not a checkpoint");
    hid_t empty = H5Fcreate(at("empty.hdf"), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    H5Fclose(empty);
    assert_int_equal(sphpa_snapshot_read(at("empty.hdf"), &p, NULL, &err), SPHPA_ERROR_FORMAT);
    assert_says(&err, SPHPA_ERROR_FORMAT, "no group /PartType0");
    assert_int_equal(sphpa_snapshot_read(at("nowhere.hdf"), &p, NULL, &err), SPHPA_ERROR_FILE);
    assert_int_equal(sphpa_snapshot_read(at("nowhere.hdf"), &p, NULL, NULL), SPHPA_ERROR_FILE);
    free(whole);
    world_free(w);
    witness_free(&t);
}

/* one number of a dataset or attribute of a checkpoint, changed by somebody else */
static void poke(const char *path, const char *set, size_t place, double value) {
    double data[3000];
    hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT);
    hid_t field = H5Dopen2(file, set, H5P_DEFAULT);
    assert_true(H5Dread(field, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0);
    data[place] = value;
    assert_true(H5Dwrite(field, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0);
    H5Dclose(field);
    H5Fclose(file);
}

static void poke_int(const char *path, const char *name, int value) {
    hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT);
    hid_t group = H5Gopen2(file, "/sphpa", H5P_DEFAULT);
    hid_t a = H5Aopen(group, name, H5P_DEFAULT);
    assert_true(a >= 0 && H5Awrite(a, H5T_NATIVE_INT, &value) >= 0);
    H5Aclose(a);
    H5Gclose(group);
    H5Fclose(file);
}

static void unlink_object(const char *path, const char *name) {
    hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT);
    assert_true(H5Ldelete(file, name, H5P_DEFAULT) >= 0);
    H5Fclose(file);
}

/* ghosts that these edges would not have made are not taken from a file */
static void test_foreign_ghosts(void **state) {
    (void)state;
    world *w = world_with_edges(), *other = world_with_edges();
    sphpa_error err;
    const char *path = at("ghosts.hdf");
    world_make(w);
    other->edges.edge_low[0] = SPHPA_EDGE_NONE;
    world_make(other);
    steps(&w->sim, 3);
    assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_OK);
    assert_int_equal(sphpa_checkpoint_read(&other->sim, path, &err), SPHPA_ERROR_FORMAT);
    assert_says(&err, SPHPA_ERROR_FORMAT, "edges");
    size_t bytes, image = 0, real = 0;
    while (w->sim.p.ghost[image] < 2) image++;
    while (w->sim.p.ghost[real] != 0) real++;
    char *whole = slurp(path, &bytes);
    const struct {
        const char *field;
        size_t place;
        double value;
    } bad[8] = {{"/PartType0/GhostParents", image, (double)w->sim.p.n},
                {"/PartType0/GhostParents", image, -1.0},
                {"/PartType0/GhostParents", image, (double)image}, /* its own */
                {"/PartType0/GhostParents", real, 0.0},
                {"/PartType0/GhostParents", real, -65.0},
                {"/PartType0/GhostImages", image, 28.0},
                {"/PartType0/GhostImages", image, 10.0}, /* of an axis that there is not */
                {"/PartType0/GhostImages", real, -1.0}};
    for (int k = 0; k < 8; k++) {
        poke(path, bad[k].field, bad[k].place, bad[k].value);
        assert_int_equal(sphpa_checkpoint_read(&w->sim, path, &err), SPHPA_ERROR_FORMAT);
        assert_says(&err, SPHPA_ERROR_FORMAT, "ghost");
        spill(path, whole, bytes);
    }
    assert_int_equal(sphpa_checkpoint_read(&w->sim, path, &err), SPHPA_OK);
    steps(&w->sim, 2);
    free(whole);
    world_free(w);
    world_free(other);
}

static void test_changed_checkpoints(void **state) {
    (void)state;
    witness t = witness_new();
    world *w = world_new(2, 10);
    world_make(w);
    steps(&w->sim, 5);
    sphpa_error err;
    const char *path = at("changed.hdf");
    assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_OK);
    size_t bytes;
    char *whole = slurp(path, &bytes);
    poke(path, "/PartType0/Velocities", 17, nan(""));
    assert_int_equal(sphpa_checkpoint_read(&t.w->sim, path, &err), SPHPA_ERROR_NOT_FINITE);
    assert_says(&err, SPHPA_ERROR_NOT_FINITE, "particle 5 ");
    assert_same_bits(&t.w->sim, &t.twin->sim);
    spill(path, whole, bytes);
    poke(path, "/PartType0/Pressures", 3, nan("")); /* not a state, but a restart starts from it */
    assert_int_equal(sphpa_checkpoint_read(&t.w->sim, path, &err), SPHPA_ERROR_NOT_FINITE);
    assert_says(&err, SPHPA_ERROR_NOT_FINITE, "Pressures is NaN");
    spill(path, whole, bytes);
    poke(path, "/PartType0/Densities", 3, -1.0);
    assert_int_equal(sphpa_checkpoint_read(&t.w->sim, path, &err), SPHPA_ERROR_NEGATIVE);
    spill(path, whole, bytes);
    poke(path, "/PartType0/MaterialIDs", 5, 100000.0); /* the module has one */
    assert_int_equal(sphpa_checkpoint_read(&t.w->sim, path, &err), SPHPA_ERROR_RANGE);
    assert_says(&err, SPHPA_ERROR_RANGE, "material 100000 of 1");
    assert_same_bits(&t.w->sim, &t.twin->sim);
    spill(path, whole, bytes);
    poke_int(path, "format", 99);
    witness_reads(&t, path, SPHPA_ERROR_FORMAT, "format 99");
    spill(path, whole, bytes);
    poke_int(path, "bytes of sphpa_real", 12 - (int)sizeof(sphpa_real));
    witness_reads(&t, path, SPHPA_ERROR_FORMAT, "bytes of sphpa_real");
    spill(path, whole, bytes);
    poke_int(path, "particles", 101);
    witness_reads(&t, path, SPHPA_ERROR_FORMAT, "100 rows of 3 numbers, not 101 of 3");
    spill(path, whole, bytes);
    poke_int(path, "last limit", 77);
    witness_reads(&t, path, SPHPA_ERROR_FORMAT, "clock");
    spill(path, whole, bytes);
    unlink_object(path, "/PartType0/Accelerations");
    witness_reads(&t, path, SPHPA_ERROR_FORMAT, "lacks the field \"Accelerations\"");
    spill(path, whole, bytes);
    unlink_object(path, "/sphpa/Kept/dye.history");
    assert_int_equal(sphpa_checkpoint_read(&t.w->sim, path, &err), SPHPA_ERROR_FORMAT);
    assert_says(&err, SPHPA_ERROR_FORMAT, "\"dye.history\"");
    assert_same_bits(&t.w->sim, &t.twin->sim);
    spill(path, whole, bytes);
    t.w->colour.refuse = 1; /* the module itself says no: everything goes back */
    witness_reads(&t, path, SPHPA_ERROR_RANGE, "does not like");
    free(whole);
    world_free(w);
    witness_free(&t);
}

/* what: 0 kernel, 1 integrator, 2 box, 3 open box, 4 passes, 5 modules, 6 dimension, 7 fields */
static void test_other_scenes(void **state) {
    (void)state;
    static const char *const words[] = {"kernel is \"quintic\", here it is \"cubic\"",
                                        "integrator",
                                        "axis 1 is periodic [-1, 1.5]",
                                        "axis 0 is open",
                                        "is \"gas balsara\", here it is \"gas ",
                                        "here it is \"dye grows\"",
                                        "dimension is 1, here it is 2",
                                        "it has the field \"Damages\""};
    witness t = witness_new();
    for (int what = 0; what < 8; what++) {
        world *w = world_new(what == 6 ? 1 : 2, what == 6 ? 20 : 12);
        sphpa_error err;
        if (what == 0) w->options.kernel = SPHPA_KERNEL_QUINTIC;
        if (what == 1) w->options.integrator = SPHPA_RK2;
        if (what == 2) w->options.box.high[1] = 1.5;
        if (what == 3) memset(&w->options.box, 0, sizeof w->options.box);
        w->params.viscosity.balsara = what == 4;
        w->plain = what == 5;
        w->colour.more = what == 7;
        world_make(w);
        steps(&w->sim, 1);
        const char *path = at("other.hdf");
        assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_OK);
        witness_reads(&t, path, SPHPA_ERROR_FORMAT, words[what]);
        world_free(w);
    }
    witness_free(&t);
}

/* a bad state does not replace a good checkpoint */
static void test_bad_state_is_not_kept(void **state) {
    (void)state;
    world *w = world_new(2, 10);
    world_make(w);
    steps(&w->sim, 2);
    sphpa_error err;
    const char *path = at("good.hdf");
    size_t before, after;
    assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_OK);
    char *old = slurp(path, &before);
    w->sim.p.u[5] = nan("");
    assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_ERROR_NOT_FINITE);
    w->sim.p.u[5] = 1.0;
    w->sim.p.P[5] = (sphpa_real)nan("");
    assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_ERROR_NOT_FINITE);
    assert_says(&err, SPHPA_ERROR_NOT_FINITE, "Pressures");
    char *kept = slurp(path, &after);
    assert_int_equal(before, after);
    assert_memory_equal(old, kept, before);
    free(old);
    free(kept);
    world_free(w);
}

/* a file that is written is whole or not there; an older one stays as it was */
static void fails_to_write(world *w, const char *path, const char *words) {
    sphpa_error err;
    const double times[1] = {0.0};
    static const char *const names[1] = {"a.hdf"};
    bool there = exists(path);
    size_t before = 0, after = 0;
    char *old = there ? slurp(path, &before) : NULL;
    assert_int_equal(sphpa_snapshot_write(&w->sim, path, NULL, &err), SPHPA_ERROR_FILE);
    assert_says(&err, SPHPA_ERROR_FILE, words);
    assert_non_null(strstr(err.message, path));
    assert_no_part(path);
    assert_nothing_open();
    assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_ERROR_FILE);
    assert_says(&err, SPHPA_ERROR_FILE, words);
    assert_int_equal(sphpa_series_write(path, names, times, 1, &err),
                     there ? SPHPA_OK : SPHPA_ERROR_FILE);
    if (there) spill(path, old, before);
    assert_no_part(path);
    assert_nothing_open();
    assert_int_equal(exists(path), there);
    char *kept = there ? slurp(path, &after) : NULL;
    assert_int_equal(before, after);
    if (there) assert_memory_equal(old, kept, before);
    free(old);
    free(kept);
}

static void test_failing_writes(void **state) {
    (void)state;
    world *w = world_new(2, 10);
    world_make(w);
    steps(&w->sim, 2);
    sphpa_error err;
    fails_to_write(w, at("no_such_directory/a.hdf"), "No such file");
    spill(at("plain_file"), "x", 1);
    fails_to_write(w, at("plain_file/a.hdf"), "Not a directory");
    assert_int_equal(mkdir(at("a_directory.hdf"), 0777), 0);
    assert_int_equal(sphpa_snapshot_write(&w->sim, at("a_directory.hdf"), NULL, &err),
                     SPHPA_ERROR_FILE);
    assert_says(&err, SPHPA_ERROR_FILE, "irectory");
    assert_no_part(at("a_directory.hdf"));
    if (geteuid() != 0) { /* root writes everywhere */
        assert_int_equal(mkdir(at("locked"), 0555), 0);
        fails_to_write(w, at("locked/a.hdf"), "Permission denied");
    }
    world_free(w);
}

/* a disk that is full after some bytes, as the system's limit on the size of a file makes it */
static void test_full_disk(void **state) {
    (void)state;
    world *w = world_new(2, 10);
    world_make(w);
    steps(&w->sim, 2);
    sphpa_error err;
    const char *path = at("full.hdf");
    struct rlimit was, small;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &was), 0);
    void (*handler)(int) = signal(SIGXFSZ, SIG_IGN);
    const rlim_t sizes[] = {0, 1000, 20000, 40000};
    for (size_t k = 0; k < 2 * sizeof sizes / sizeof sizes[0]; k++) {
        if (k == 4) /* and now with an older file in its place */
            assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_OK);
        size_t before = 0, after = 0;
        char *old = k >= 4 ? slurp(path, &before) : NULL;
        small = was;
        small.rlim_cur = sizes[k % 4];
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
        sphpa_result one = sphpa_snapshot_write(&w->sim, path, NULL, &err);
        sphpa_result two = sphpa_checkpoint_write(&w->sim, path, NULL, &err);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &was), 0);
        assert_true(one == SPHPA_ERROR_FILE && two == SPHPA_ERROR_FILE);
        assert_says(&err, SPHPA_ERROR_FILE, "the disk has room");
        assert_no_part(path);
        assert_nothing_open();
        assert_int_equal(exists(path), k >= 4);
        char *kept = k >= 4 ? slurp(path, &after) : NULL;
        assert_int_equal(before, after);
        if (k >= 4) assert_memory_equal(old, kept, before);
        free(old);
        free(kept);
    }
    signal(SIGXFSZ, handler);
    assert_int_equal(sphpa_checkpoint_write(&w->sim, path, NULL, &err), SPHPA_OK);
    assert_int_equal(sphpa_checkpoint_read(&w->sim, path, &err), SPHPA_OK);
    world_free(w);
}

static herr_t own_printer(hid_t stack, void *data) {
    (void)stack;
    ++*(int *)data;
    return 0;
}

/* the library says nothing on stderr, and the program's own printer is back afterwards */
static void test_silence(void **state) {
    (void)state;
    world *w = world_new(2, 10);
    world_make(w);
    sphpa_particles p;
    sphpa_error err;
    int calls = 0;
    size_t bytes;
    foreign_file(at("foreign.hdf"), 0);
    char *whole = slurp(at("foreign.hdf"), &bytes);
    spill(at("torn.hdf"), whole, bytes - 1);
    free(whole);
    fflush(stderr);
    int real = dup(2);
    FILE *catcher = freopen(at("stderr"), "wb", stderr);
    assert_non_null(catcher);
    sphpa_result results[3];
    results[0] = sphpa_checkpoint_read(&w->sim, at("torn.hdf"), &err);
    results[1] = sphpa_snapshot_read(at("torn.hdf"), &p, NULL, &err);
    results[2] = sphpa_snapshot_write(&w->sim, at("none/a.hdf"), NULL, &err);
    fflush(stderr);
    dup2(real, 2);
    close(real);
    for (int k = 0; k < 3; k++) assert_int_not_equal(results[k], SPHPA_OK);
    char *said = slurp(at("stderr"), &bytes);
    assert_int_equal(bytes, 0);
    free(said);
    H5E_auto2_t before, after;
    void *before_data, *after_data;
    H5Eget_auto2(H5E_DEFAULT, &before, &before_data);
    H5Eset_auto2(H5E_DEFAULT, own_printer, &calls);
    assert_int_not_equal(sphpa_checkpoint_read(&w->sim, at("torn.hdf"), &err), SPHPA_OK);
    assert_int_equal(calls, 0);
    H5Eget_auto2(H5E_DEFAULT, &after, &after_data);
    assert_true(after == own_printer && after_data == &calls);
    assert_true(H5Fopen(at("torn.hdf"), H5F_ACC_RDONLY, H5P_DEFAULT) < 0);
    assert_int_equal(calls, 1);
    H5Eset_auto2(H5E_DEFAULT, before, before_data);
    world_free(w);
}

static void test_bad_names(void **state) {
    (void)state;
    world *w = world_new(2, 10);
    world_make(w);
    sphpa_error err;
    sphpa_setting twice[2] = {{"Run:a", "1"}, {"Run:a", "2"}};
    sphpa_snapshot_info info = info_of_run();
    info.settings = twice;
    assert_int_equal(sphpa_snapshot_write(&w->sim, at("names.hdf"), &info, &err),
                     SPHPA_ERROR_RANGE);
    assert_says(&err, SPHPA_ERROR_RANGE, "Run:a");
    static const char *const names[] = {"a/b", ".", "Densities", "Density"};
    for (int k = 0; k < 4; k++) {
        strcpy(w->sim.p.column[0].name, names[k]);
        assert_int_not_equal(sphpa_snapshot_write(&w->sim, at("names.hdf"), NULL, &err), SPHPA_OK);
        assert_non_null(strstr(err.message, names[k]));
        assert_nothing_open();
    }
    assert_false(exists(at("names.hdf")));
    assert_no_part(at("names.hdf"));
    world_free(w);
}

static void test_series(void **state) {
    (void)state;
    static const char *const names[] = {"s_0000.hdf", "a \"b\"\\.hdf"};
    const double times[] = {0.0, 5e-7}, bad[] = {0.0, nan("")};
    sphpa_error err;
    size_t bytes;
    assert_int_equal(sphpa_series_write(at("s.hdf.series"), names, times, 2, &err), SPHPA_OK);
    char *text = slurp(at("s.hdf.series"), &bytes);
    assert_string_equal(text, "{\n  \"file-series-version\": \"1.0\",\n  \"files\": [\n"
                              "    { \"name\": \"s_0000.hdf\", \"time\": 0 },\n"
                              "    { \"name\": \"a \\\"b\\\"\\\\.hdf\", \"time\": "
                              "4.9999999999999998e-07 }\n  ]\n}\n");
    free(text);
    assert_int_equal(sphpa_series_write(at("s.hdf.series"), names, bad, 2, &err),
                     SPHPA_ERROR_NOT_FINITE);
    text = slurp(at("s.hdf.series"), &bytes);
    assert_non_null(strstr(text, "s_0000"));
    free(text);
    assert_int_equal(sphpa_series_write(at("s.hdf.series"), NULL, NULL, 0, &err), SPHPA_OK);
    assert_no_part(at("s.hdf.series"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layout),
        cmocka_unit_test(test_open_box_and_defaults),
        cmocka_unit_test(test_partly_periodic_box),
        cmocka_unit_test(test_restart),
        cmocka_unit_test(test_restart_of_strong_shocks),
        cmocka_unit_test(test_restart_with_edges),
        cmocka_unit_test(test_foreign_ghosts),
        cmocka_unit_test(test_restart_of_anything),
        cmocka_unit_test(test_restart_with_smaller_steps),
        cmocka_unit_test(test_restart_with_other_limits),
        cmocka_unit_test(test_restart_after_an_output),
        cmocka_unit_test(test_blobs),
        cmocka_unit_test(test_snapshot_as_start),
        cmocka_unit_test(test_foreign_units),
        cmocka_unit_test(test_foreign_errors),
        cmocka_unit_test(test_broken_files),
        cmocka_unit_test(test_changed_checkpoints),
        cmocka_unit_test(test_other_scenes),
        cmocka_unit_test(test_bad_state_is_not_kept),
        cmocka_unit_test(test_failing_writes),
        cmocka_unit_test(test_full_disk),
        cmocka_unit_test(test_silence),
        cmocka_unit_test(test_bad_names),
        cmocka_unit_test(test_series),
    };
    return cmocka_run_group_tests_name("snapshot", tests, setup_directory, remove_directory);
}
