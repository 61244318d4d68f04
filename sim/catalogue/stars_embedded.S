/* The stars that are part of the program: the bytes of a catalogue file, see star_index.h. */
        .section .rodata
        .balign 64
        .global bst_stars_embedded_begin
        .type bst_stars_embedded_begin, %object
bst_stars_embedded_begin:
        .incbin BST_STARS_EMBEDDED_FILE
        .global bst_stars_embedded_end
        .type bst_stars_embedded_end, %object
bst_stars_embedded_end:
        .byte 0
        .section .note.GNU-stack, "", %progbits
