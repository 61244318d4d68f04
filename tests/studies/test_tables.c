/* Tables of a study from rows written by hand: each cell by arithmetic on paper. */
#include <math.h>
#include <sqlite3.h>

#include "sim/studies/tables.h"
#include "tests/studies/fake_kind.h"

enum { REPLICATES = 4, SETTINGS = 6, RUNS = REPLICATES * SETTINGS, SERIES = 4 };

/* Three values of a run, the key and the counts of a part, and a mean that one run lacks. */
static const bst_study_metric series_columns[] = {{"key", "m", "Key.", BST_METRIC_KEY},
                                                  {"trials", "", "Trials.", BST_METRIC_TRIALS},
                                                  {"hits", "", "Hits.", BST_METRIC_HITS},
                                                  {"level", "e", "Level.", BST_METRIC_VALUE}};

typedef struct fixture {
    char folder[BST_TEST_PATH];
    bst_ctx ctx;
    bst_study study;
    bst_study_kind kind;
    bst_results results;
    sqlite3 *db;
} fixture;

/* Run 5 failed; the second figure of run r is 1 for every third; the third is r^2, of no run 10. */
static void fill(fixture *f) {
    bst_results *r = &f->results;
    bst_assert_ok(&f->ctx, bst_results_create(&f->ctx, &f->study, &f->kind, r));
    r->errors = calloc(1, sizeof *r->errors);
    r->errors[r->error_count++] = (bst_study_row_error){5, strdup("no star")};
    r->parts = calloc(RUNS, sizeof *r->parts);
    r->series = calloc((size_t)RUNS * 2 * SERIES, sizeof *r->series);
    for (int run = 0; run < RUNS; run++) {
        bool failed = run == 5;
        double *m = r->metrics + (size_t)run * 3;
        r->state[run] = failed ? BST_ROW_FAILED : BST_ROW_DONE;
        r->done++;
        r->failed += failed;
        m[0] = failed ? NAN : 100.0 * (run / REPLICATES) + run % REPLICATES;
        m[1] = failed ? NAN : run % 3 == 0;
        m[2] = failed || run == 10 ? NAN : (double)(run * run);
        r->wall_s[run] = 2.0 + run;
        r->cpu_s[run] = 50.0 - 0.5 * run;
        if (failed) {
            continue;
        }
        r->parts[r->part_count++] = (bst_study_series_part){run, r->series_rows, 2};
        for (int i = 0; i < 2; i++) {
            double *s = r->series + r->series_rows++ * SERIES;
            s[0] = i == 0 ? 7.0 : 2.0; /* keys fall within a run */
            s[1] = 10.0 + i;
            s[2] = run % 4 + i;
            s[3] = run == 2 ? NAN : 0.5 * run + 100.0 * i;
        }
    }
}

static int set_up(void **state) {
    fixture *f = calloc(1, sizeof *f);
    char path[BST_TEST_PATH + 32];
    fixture_folder(f->folder);
    bst_assert_ok(
        &f->ctx,
        fixture_open(&f->ctx, f->folder,
                     "\"seed\": \"0x1f\", \"replicates\": 4, \"sweeps\": [{\"axes\": [{\"path\": "
                     "\"/b/c\", \"values\": [1.5, 4]}]}, {\"design\": \"one_at_a_time\", \"axes\": "
                     "[{\"path\": \"/word\", \"values\": [\"p\", \"q\"]}]}], "
                     "\"dispersions\": [{\"path\": \"/a\", \"from\": 0, \"to\": 1}], "
                     "\"metrics\": [\"gaps\", \"flag\", \"gaps\", \"third\"]",
                     &f->study));
    assert_int_equal(f->study.runs, RUNS);
    f->kind = fake_kind;
    f->kind.series = series_columns;
    f->kind.series_count = SERIES;
    fill(f);
    bst_assert_ok(&f->ctx, bst_study_write_tables(&f->ctx, &f->results, f->folder));
    snprintf(path, sizeof path, "%s/study.sqlite", f->folder);
    assert_int_equal(sqlite3_open(path, &f->db), SQLITE_OK);
    *state = f;
    return 0;
}

static int tear_down(void **state) {
    fixture *f = *state;
    assert_int_equal(sqlite3_close(f->db), SQLITE_OK);
    bst_results_free(&f->results);
    bst_study_close(&f->study);
    fixture_remove(f->folder);
    free(f);
    return 0;
}

/* Rows of a query: cells separated by a comma, rows by a semicolon, NULL as "-". */
static void expect(const fixture *f, const char *sql, const char *wanted) {
    char text[4000] = "";
    size_t n = 0;
    sqlite3_stmt *s;
    if (sqlite3_prepare_v2(f->db, sql, -1, &s, NULL) != SQLITE_OK) {
        fail_msg("%s: %s", sql, sqlite3_errmsg(f->db));
    }
    while (sqlite3_step(s) == SQLITE_ROW) {
        for (int c = 0; c < sqlite3_column_count(s); c++) {
            bool real = sqlite3_column_type(s, c) == SQLITE_FLOAT;
            const char *between = c > 0 ? "," : n > 0 ? ";" : "";
            n += (size_t)(real ? snprintf(text + n, sizeof text - n, "%s%.6g", between,
                                          sqlite3_column_double(s, c))
                          : sqlite3_column_type(s, c) == SQLITE_NULL
                              ? snprintf(text + n, sizeof text - n, "%s-", between)
                              : snprintf(text + n, sizeof text - n, "%s%s", between,
                                         (const char *)sqlite3_column_text(s, c)));
            assert_true(n < sizeof text);
        }
    }
    sqlite3_finalize(s);
    if (strcmp(text, wanted) != 0) {
        fail_msg("%s\n  gave   %s\n  wanted %s", sql, text, wanted);
    }
}

static void what_is_varied(void **state) {
    const fixture *f = *state;
    expect(f,
           "select value from about where key in ('name','kind','seed','settings','replicates',"
           "'runs','runs_done','runs_failed') order by rowid",
           "test;loop;0x1F;6;4;24;24;1");
    expect(f, "select * from scenarios", "0,base");
    expect(f, "select axis,path,role,design,sweep from axes",
           "0,/b/c,sweep,grid,0;1,/word,sweep,one_at_a_time,1;2,/a,dispersion,-,-");
    expect(f, "select metric,unit,kind from metrics", "gaps,,value;flag,,rate;third,s,value");
    /* the last sweep varies fastest; level 0 of one_at_a_time is the scenario's own word */
    expect(f, "select * from settings", "0,0,1.5,x;1,0,1.5,p;2,0,1.5,q;3,0,4,x;4,0,4,p;5,0,4,q");
}

static void rows_of_runs(void **state) {
    const fixture *f = *state;
    expect(f,
           "select run,setting,replicate,run_number,scenario,status,error,gaps,flag,third from "
           "runs where run in (4,5,6,10,23)",
           "4,1,0,4,0,done,-,16,0,100;5,1,1,5,0,failed,no star,-,-,-;6,1,2,6,0,done,-,36,1,102;"
           "10,2,2,10,0,done,-,-,0,202;23,5,3,23,0,done,-,529,0,503");
    expect(f, "select count(*), count(distinct a), min(a) >= 0, max(a) < 1 from runs", "24,24,1,1");
    expect(f, "select c, word from runs where run in (0, 7, 12, 20)", "1.5,x;1.5,p;4,x;4,q");
    expect(f, "select * from speed where run in (0,23)", "0,2,50;23,25,38.5");
}

static void statistics(void **state) {
    const fixture *f = *state;
    /* all: 0..23 less 5: flags at 0,3..21; squares less 10 too */
    expect(f,
           "select metric,method,runs,missing,mean,minimum,maximum from statistics where setting "
           "is null",
           "gaps,bootstrap,22,2,190.864,0,529;flag,wilson,23,1,0.347826,0,1;"
           "third,bootstrap,23,1,258.043,0,503");
    /* setting 3: runs 12..15, of the values 300..303 and squares 144, 169, 196, 225 */
    expect(f,
           "select metric,runs,missing,mean,std,minimum,p05,p25,median,p75,p95,maximum from "
           "statistics where setting=3",
           "gaps,4,0,183.5,34.876,144,147.75,162.75,182.5,203.25,220.65,225;"
           "flag,4,0,0.5,0.57735,0,0,0,0.5,1,1,1;"
           "third,4,0,301.5,1.29099,300,300.15,300.75,301.5,302.25,302.85,303");
    expect(f, "select runs,missing,mean from statistics where setting=1 and metric='third'",
           "3,1,101.667");
    /* Wilson's interval of 2 of 4: 0.5 +- 1.96 sqrt(0.25 / (4 + 1.96^2)) */
    expect(f, "select low,high from statistics where setting=3 and metric='flag'",
           "0.150039,0.849961");
    expect(f,
           "select count(*) from statistics where low <= mean and mean <= high and high - low < "
           "maximum - minimum + 1e-9 and setting is not null",
           "18");
}

/* Means of settings 1, 2 less setting 0 of the same first level: 101.667 without run 5, 201.5. */
static void effects(void **state) {
    const fixture *f = *state;
    expect(f,
           "select sweep,design,rank,axis,effect,mean_effect,effects from sensitivity where "
           "metric='third'",
           "1,one_at_a_time,1,word,200,99.9167,2");
    /* speeds by the least of a setting: 2, 6, 10 and 14, 18, 22; 48.5 falls by 2 a setting */
    expect(f, "select metric,effect,mean_effect,spread from speed_sensitivity",
           "wall_s,8,4,0;cpu_s,4,-2,0");
}

static void parts(void **state) {
    const fixture *f = *state;
    expect(f, "select * from parts where run in (2,23)",
           "2,7,10,2,-;2,2,11,3,-;23,7,10,3,11.5;23,2,11,4,111.5");
    /* setting 0: hits 0..3 of 4 x 10, and 1..4 of 4 x 11; levels of runs 0, 1, 3 */
    expect(f,
           "select setting,runs,key,trials,hits,rate,level from parts_statistics where setting < 2",
           "0,4,2,44,10,0.227273,100.667;0,4,7,40,6,0.15,0.666667;"
           "1,3,2,33,8,0.242424,102.833;1,3,7,30,5,0.166667,2.83333");
    /* Wilson: (6 + z^2 / 2 +- z sqrt(6 x 34 / 40 + z^2 / 4)) / (40 + z^2) */
    expect(f, "select rate_low,rate_high from parts_statistics where setting=0 and key=7",
           "0.0706119,0.290723");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_varied), cmocka_unit_test(rows_of_runs),
        cmocka_unit_test(statistics),     cmocka_unit_test(effects),
        cmocka_unit_test(parts),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
