#include "tracker/attitude/photocentre.h"

#include <math.h>

bst_vec3 bst_photocentre(const bst_star *star, const bst_star *near, int count, double radius_rad) {
    bst_vec3 sum = star->icrs;
    for (int i = 0; i < count; i++) {
        bst_vec3 apart = bst_vec3_sub(near[i].icrs, star->icrs);
        double distance = bst_vec3_norm(apart);
        if (distance <= radius_rad && (near[i].id != star->id || distance > 0.0)) {
            double share = pow(10.0, -0.4 * ((double)near[i].v_mag - (double)star->v_mag));
            sum = bst_vec3_axpy(sum, share, near[i].icrs);
        }
    }
    return bst_vec3_unit(sum);
}
