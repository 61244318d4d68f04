/* Channel track_identities: probabilities of tracks over the objects of the onboard catalogue. */
#ifndef BORESIGHT_MESSAGES_TRACK_IDENTITIES_H
#define BORESIGHT_MESSAGES_TRACK_IDENTITIES_H

#include <stdint.h>

#define BST_CHANNEL_TRACK_IDENTITIES "track_identities"

typedef struct bst_track_identity {
    int64_t track_id; /* as in tracks */
    int32_t object;   /* index in the catalogue; -1: none of its objects. A cue that names no object
                         is no object here */
    double probability; /* 0 to 1 */
} bst_track_identity;

/* track_identities (queue): a comparison of the confirmed tracks with the catalogue. The
 * probabilities of a track add up to 1; those below 0.001 are left out. */
typedef struct bst_track_identities {
    int64_t exposure_id;
    int64_t tick;        /* mid-exposure */
    int32_t count, lost; /* lost: tracks and objects without room, whose share is in object -1 */
    bst_track_identity items[];
} bst_track_identities;

#endif
