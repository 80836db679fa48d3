// Where the network's numbers lie: of each layer the weights, a row an output, then the biases (core's
// render::alpha::network::Places).

const HIDDEN: u32 = 64u;
const FIRST_BIAS: u32 = 256u;
const SECOND: u32 = 320u;
const SECOND_BIAS: u32 = 4416u;
const LAST: u32 = 4480u;
const LAST_BIAS: u32 = 4608u;
const PARAMETERS: u32 = 4610u;
