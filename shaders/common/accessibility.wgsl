// Two samples of accessibility in a word: unorm16, or float16 where such textures cannot be filtered.
override HALF_FLOATS: bool = false;

fn pack_samples(samples: vec2<f32>) -> u32 {
    return select(pack2x16unorm(samples), pack2x16float(samples), HALF_FLOATS);
}

fn unpack_sample(word: u32, which: u32) -> f32 {
    let both = select(unpack2x16unorm(word), unpack2x16float(word), HALF_FLOATS);
    return select(both.x, both.y, which == 1u);
}
