// Where the words of planes lie: the finest one's by themselves, those of all others one behind the other, so that a
// picture of 8K is seen in parts of 128 MiB. Kernels bind the two as `finest` and `coarser`.

// How many words the finest plane has. Words are numbered through all planes: from this one on they are the others'.
fn finest_words() -> u32 {
    return frame.levels[0].width * frame.levels[0].rows;
}
